// What the extension's JSON claims is checked before memory is taken or the library is called, which asserts
// the same [EXT_meshopt_compression, "Specifying compressed views"].
#include "patina/asset/meshopt_views.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

namespace patina::asset {
namespace {

constexpr const char* kRemedy = "export the file again, or without compression";

enum class Mode { kAttributes, kTriangles, kIndices };
enum class Filter { kNone, kOctahedral, kQuaternion, kExponential };

struct CompressedView {
  std::span<const uint8_t> data;
  size_t stride = 0, count = 0;  // bytes of an element, elements
  Mode mode = Mode::kAttributes;
  Filter filter = Filter::kNone;
};

Mode mode_of(const JsonView& json) {
  const std::string& name = json.string();
  if (name == "ATTRIBUTES") return Mode::kAttributes;
  if (name == "TRIANGLES") return Mode::kTriangles;
  if (name == "INDICES") return Mode::kIndices;
  json.fail("expected ATTRIBUTES, TRIANGLES or INDICES, found '" + printable(name, 20) + "'");
}

Filter filter_of(const JsonView& json) {
  const std::string& name = json.string();
  if (name == "NONE") return Filter::kNone;
  if (name == "OCTAHEDRAL") return Filter::kOctahedral;
  if (name == "QUATERNION") return Filter::kQuaternion;
  if (name == "EXPONENTIAL") return Filter::kExponential;
  if (name == "COLOR")
    json.fail(
        "filtered colours are not read; write the file with EXT_meshopt_compression or without compression",
        ErrorCode::kUnsupported);
  json.fail("expected NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL, found '" + printable(name, 20) + "'");
}

void check_stride(const JsonView& json, const CompressedView& view) {
  const JsonView stride = json.at("byteStride");
  const auto expect = [&](bool holds, const char* what) {
    if (!holds) stride.fail(fmt::format("expected {}, found {}", what, view.stride));
  };
  if (view.mode != Mode::kAttributes)
    expect(view.stride == 2 || view.stride == 4, "indices of 2 or 4 bytes");
  else if (view.filter == Filter::kOctahedral)
    expect(view.stride == 4 || view.stride == 8, "4 or 8 bytes for octahedral vectors");
  else if (view.filter == Filter::kQuaternion)
    expect(view.stride == 8, "8 bytes for quaternions");
  else
    expect(view.stride % 4 == 0, "a multiple of 4 bytes");
}

CompressedView described(const SourceDocument& d, const JsonView& json) {
  CompressedView view;
  const JsonView reference = json.at("buffer");
  const size_t buffer = reference.index(d.buffers.size(), "buffer");
  const std::span<const uint8_t> bytes = d.buffers[buffer].bytes;
  const auto offset_json = json.find("byteOffset");
  const auto offset = static_cast<uint64_t>(offset_json ? offset_json->integer(0, int64_t{1} << 40) : 0);
  const auto length = static_cast<uint64_t>(json.at("byteLength").integer(1, int64_t{1} << 40));
  if (offset > bytes.size() || length > bytes.size() - offset)
    json.fail(fmt::format("compressed bytes {} to {} lie outside of buffer {}, which has {}", offset,
                          offset + length, buffer, bytes.size()));
  view.data = bytes.subspan(offset, length);
  view.stride = static_cast<size_t>(json.at("byteStride").integer(2, 256));
  view.count = static_cast<size_t>(json.at("count").integer(1, int64_t{1} << 40));
  view.mode = mode_of(json.at("mode"));
  if (const auto filter = json.find("filter")) view.filter = filter_of(*filter);
  if (view.filter != Filter::kNone && view.mode != Mode::kAttributes)
    json.at("filter").fail("only attributes have a filter");
  if (view.mode == Mode::kTriangles && view.count % 3 != 0)
    json.at("count").fail(fmt::format("expected a multiple of 3 for triangles, found {}", view.count));
  check_stride(json, view);
  return view;
}

int decode(const CompressedView& view, std::vector<uint8_t>& out) {
  switch (view.mode) {
    case Mode::kTriangles:
      return meshopt_decodeIndexBuffer(out.data(), view.count, view.stride, view.data.data(),
                                       view.data.size());
    case Mode::kIndices:
      return meshopt_decodeIndexSequence(out.data(), view.count, view.stride, view.data.data(),
                                         view.data.size());
    case Mode::kAttributes:
      break;
  }
  return meshopt_decodeVertexBuffer(out.data(), view.count, view.stride, view.data.data(), view.data.size());
}

void undo_filter(const CompressedView& view, std::vector<uint8_t>& out) {
  if (view.filter == Filter::kOctahedral) meshopt_decodeFilterOct(out.data(), view.count, view.stride);
  if (view.filter == Filter::kQuaternion) meshopt_decodeFilterQuat(out.data(), view.count, view.stride);
  if (view.filter == Filter::kExponential) meshopt_decodeFilterExp(out.data(), view.count, view.stride);
}

// `max_bytes` is how large the result may be.
std::vector<uint8_t> decompressed(const JsonView& json, const CompressedView& view, uint64_t max_bytes) {
  // Neither factor exceeds 2^40 or 2^8.
  const uint64_t bytes = uint64_t{view.count} * view.stride;
  if (bytes > max_bytes)
    json.at("count").fail(
        fmt::format("{} elements of {} bytes are more than {} compressed bytes can hold; {}", view.count,
                    view.stride, view.data.size(), kRemedy),
        ErrorCode::kLimit);
  std::vector<uint8_t> out(bytes);
  if (decode(view, out) != 0) {
    // The first byte is 0xa0 and the version of the vertex codec.
    if (view.mode == Mode::kAttributes && view.data[0] > 0xA0 && view.data[0] <= 0xAF)
      json.fail(
          fmt::format("the data is in version {} of meshopt's vertex codec, expected version 0; write the "
                      "file with EXT_meshopt_compression or without compression",
                      view.data[0] & 0x0F),
          ErrorCode::kUnsupported);
    json.fail(fmt::format("expected {} elements of {} bytes, but the {} compressed bytes are damaged; {}",
                          view.count, view.stride, view.data.size(), kRemedy));
  }
  undo_filter(view, out);
  return out;
}

}  // namespace

void decompress_meshopt_views(SourceDocument& d) {
  const auto views = d.root().find("bufferViews");
  uint64_t bytes_left = memory_budget(source_bytes(d)).decompressed_bytes;
  for (size_t i = 0; views && i < views->size(); ++i) {
    const JsonView view = (*views)[i];
    const auto extensions = view.find("extensions");
    if (!extensions) continue;
    auto json = extensions->find("EXT_meshopt_compression");
    if (!json) json = extensions->find("KHR_meshopt_compression");
    if (!json) continue;
    const CompressedView compressed = described(d, *json);
    if (const auto stride = view.find("byteStride");
        stride && compressed.stride != static_cast<size_t>(stride->integer(4, 252)))
      json->at("byteStride")
          .fail(fmt::format("expected {}, the byteStride of the view, found {}", stride->integer(4, 252),
                            compressed.stride));
    const uint64_t most = std::min<uint64_t>(bytes_left, 64 * compressed.data.size());
    d.decompressed_views.push_back(decompressed(*json, compressed, most));
    d.views[i] = d.decompressed_views.back();
    bytes_left -= d.views[i].size();
  }
}

}  // namespace patina::asset
