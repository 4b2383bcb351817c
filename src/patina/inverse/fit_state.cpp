#include "patina/inverse/fit_state.h"

#include <algorithm>
#include <cstring>

#include "patina/asset/texel_raster.h"
#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/inverse/light_schedule.h"

namespace patina::inverse {
namespace {

// Padding reaches this far beyond the islands: four mip levels of a trilinear look-up.
constexpr int kPaddingTexels = 16;

void append(std::vector<uint8_t>& bytes, const void* data, size_t size) {
  const auto* begin = static_cast<const uint8_t*>(data);
  bytes.insert(bytes.end(), begin, begin + size);
}
void append(std::vector<uint8_t>& bytes, const std::vector<float>& values) {
  append(bytes, values.data(), values.size() * sizeof(float));
}

// Reads what append wrote; sizes are known from the state that is filled.
class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  void read(void* data, size_t size) {
    if (bytes_.size() < size) fail();
    if (size > 0) std::memcpy(data, bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
  }
  void read(std::vector<float>& values) { read(values.data(), values.size() * sizeof(float)); }
  void expect_end() const {
    if (!bytes_.empty()) fail();
  }
  [[noreturn]] static void fail() {
    throw Error(ErrorCode::kFormat, "fit checkpoint",
                "belongs to other textures or options than this fit has; delete it to start the fit anew");
  }

 private:
  std::span<const uint8_t> bytes_;
};

template <class Archive>
void each_parameter(Archive&& archive, auto&& parameters) {
  for (auto& levels : parameters)
    for (auto& level : levels) archive(level.pixels);
}

}  // namespace

std::vector<asset::MaterialMaps> apply_changes(const std::vector<asset::MaterialMaps>& base,
                                               std::span<const FittedMap> fitted, Padding padding) {
  std::vector<asset::MaterialMaps> maps = base;
  for (const FittedMap& map : fitted) {
    asset::Map change = map.field.delta;
    if (padding == Padding::kIslands) change.texels = asset::dilated(change, map.evidence, kPaddingTexels);
    for (size_t i = 0; i < map.may_change.pixels.size(); ++i)
      if (map.may_change.pixels[i] <= 0.0f)
        std::fill_n(change.texels.pixels.begin() + static_cast<std::ptrdiff_t>(i) * change.texels.channels,
                    change.texels.channels, 0.0f);

    Image& texels = slot_map(maps[static_cast<size_t>(map.material)], map.slot).texels;
    change = asset::resized(change, texels.width, texels.height);
    const asset::MapSlotRow& row = asset::row_of(map.slot);
    const int fitted_channels = change.texels.channels;
    parallel_for(0, static_cast<int64_t>(texels.num_pixels()), 4096, [&](int64_t begin, int64_t end) {
      for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
        float* texel = texels.pixels.data() + i * static_cast<size_t>(texels.channels);
        const float* delta = change.texels.pixels.data() + i * static_cast<size_t>(fitted_channels);
        if (std::all_of(delta, delta + fitted_channels, [](float d) { return d == 0.0f; })) continue;
        for (int c = 0; c < fitted_channels; ++c) {
          const float stored = asset::stored_from_value(row.stored, texel[c]) + delta[c];
          // The bounds survive the way there and back only up to rounding.
          const float value = asset::value_from_stored(row.stored, std::clamp(stored, row.low, row.high));
          texel[c] = row.stored == asset::StoredAs::kRoot ? std::clamp(value, row.low, row.high) : value;
        }
        if (row.encoding == asset::MapEncoding::kNormal) {
          const vec3 n = glm::normalize(vec3(texel[0], texel[1], texel[2]));
          texel[0] = n.x, texel[1] = n.y, texel[2] = n.z;
        }
      }
    });
  }
  return maps;
}

std::vector<asset::MaterialMaps> shrunk(const std::vector<asset::MaterialMaps>& base,
                                        std::span<const FittedMap> fitted) {
  std::vector<asset::MaterialMaps> maps = base;
  for (const FittedMap& fitted_map : fitted) {
    asset::Map& map = slot_map(maps[static_cast<size_t>(fitted_map.material)], fitted_map.slot);
    const Image& size = fitted_map.field.delta.texels;
    map = asset::resized(map, size.width, size.height);
  }
  return maps;
}

Parameters parameters_of(std::span<const FittedMap> fitted) {
  Parameters parameters;
  for (const FittedMap& map : fitted) parameters.push_back(map.field.levels);
  return parameters;
}

void set_parameters(std::vector<FittedMap>& fitted, const Parameters& parameters) {
  for (size_t i = 0; i < fitted.size(); ++i) {
    fitted[i].field.levels = parameters[i];
    compose(fitted[i].field);
  }
}

Parameters sum_of(Parameters a, const Parameters& b) {
  for (size_t f = 0; f < a.size(); ++f)
    for (size_t level = 0; level < a[f].size(); ++level)
      for (size_t i = 0; i < a[f][level].pixels.size(); ++i) a[f][level].pixels[i] += b[f][level].pixels[i];
  return a;
}

FitCheckpoint make_checkpoint(const FitState& state) {
  FitCheckpoint checkpoint;
  checkpoint.next_iteration = state.next_iteration;
  std::vector<uint8_t>& bytes = checkpoint.bytes;
  const auto write = [&](const std::vector<float>& values) { append(bytes, values); };
  append(bytes, &state.damping, sizeof state.damping);
  each_parameter(write, parameters_of(state.fitted));
  each_parameter(write, state.light_parameters);
  for (const Image& displacement : state.displacements) write(displacement.pixels);
  write(state.loss);
  return checkpoint;
}

void restore_checkpoint(FitState& state, const FitCheckpoint& checkpoint) {
  Reader reader(checkpoint.bytes);
  const auto read = [&](std::vector<float>& values) { reader.read(values); };
  state.next_iteration = checkpoint.next_iteration;
  reader.read(&state.damping, sizeof state.damping);
  Parameters parameters = parameters_of(state.fitted);
  each_parameter(read, parameters);
  set_parameters(state.fitted, parameters);
  each_parameter(read, state.light_parameters);
  for (Image& displacement : state.displacements) read(displacement.pixels);
  state.loss.resize(static_cast<size_t>(std::max(0, state.next_iteration)));
  read(state.loss);
  reader.expect_end();
}

}  // namespace patina::inverse
