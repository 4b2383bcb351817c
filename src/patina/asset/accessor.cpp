#include "patina/asset/accessor.h"

#include <algorithm>
#include <cstring>

#include <fmt/format.h>

namespace patina::asset {
namespace {

Component component_of(const JsonView& json) {
  const int64_t value = json.integer(INT32_MIN, INT32_MAX);
  for (const auto c : {Component::kInt8, Component::kUint8, Component::kInt16, Component::kUint16,
                       Component::kUint32, Component::kFloat})
    if (static_cast<int64_t>(c) == value) return c;
  json.fail(
      fmt::format("component type {} is unknown, expected 5120, 5121, 5122, 5123, 5125 or 5126", value));
}

int num_components_of(const JsonView& json) {
  const std::string& type = json.string();
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  if (type == "VEC4") return 4;
  if (type == "MAT4") return 16;
  if (type == "MAT2" || type == "MAT3")
    json.fail("matrices of type " + type + " have no place in a mesh or skin");
  json.fail("accessor type '" + printable(type, 20) + "' is unknown");
}

template <class T>
T load(const uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

float float_at(const uint8_t* at, Component c, bool normalized) {
  switch (c) {
    case Component::kFloat:
      return load<float>(at);
    case Component::kUint32:
      return static_cast<float>(load<uint32_t>(at));
    case Component::kUint8:
      return normalized ? static_cast<float>(*at) / 255.0f : static_cast<float>(*at);
    case Component::kUint16:
      return static_cast<float>(load<uint16_t>(at)) / (normalized ? 65535.0f : 1.0f);
    case Component::kInt8: {
      const auto v = static_cast<float>(load<int8_t>(at));
      return normalized ? std::max(v / 127.0f, -1.0f) : v;
    }
    case Component::kInt16: {
      const auto v = static_cast<float>(load<int16_t>(at));
      return normalized ? std::max(v / 32767.0f, -1.0f) : v;
    }
  }
  return 0;
}

uint32_t integer_at(const uint8_t* at, Component c) {
  switch (c) {
    case Component::kUint8:
      return *at;
    case Component::kUint16:
      return load<uint16_t>(at);
    default:
      return load<uint32_t>(at);
  }
}

// `count` elements of `element` bytes somewhere in a buffer view.
struct Elements {
  const uint8_t* data = nullptr;
  size_t stride = 0;
  const uint8_t* at(size_t i) const { return data + i * stride; }
};

// Finds the elements that `json` (an accessor, or one part of a sparse one) describes, and checks that they
// lie in their view.
Elements elements_of(const SourceDocument& d, const JsonView& json, size_t count, size_t element,
                     bool may_stride) {
  const JsonView reference = json.at("bufferView");
  const size_t index = reference.index(d.views.size(), "bufferView");
  const auto bytes = d.views[index];
  const JsonView view = d.root().at("bufferViews")[index];
  if (bytes.empty()) view.fail("its buffer has no data");
  const auto offset_json = json.find("byteOffset");
  const auto offset = static_cast<uint64_t>(offset_json ? offset_json->integer(0, int64_t{1} << 40) : 0);
  size_t stride = element;
  if (const auto stride_json = view.find("byteStride"); stride_json && may_stride) {
    stride = static_cast<size_t>(stride_json->integer(4, 252));
    if (stride < element)
      stride_json->fail(
          fmt::format("byteStride {} is smaller than one element of {} bytes", stride, element));
  }
  // count is below 2^40 and stride below 2^8, so nothing here wraps.
  const uint64_t needed = offset + (uint64_t{count} - 1) * stride + element;
  if (needed > bytes.size())
    json.fail(fmt::format("{} elements of {} bytes from byte {} need {} bytes, the buffer view has {}", count,
                          element, offset, needed, bytes.size()));
  return {bytes.data() + offset, stride};
}

// Calls visit(element index, pointer to its components) for the base elements, then for those that a sparse
// accessor replaces.
template <class Visit>
void for_each_element(const SourceDocument& d, const AccessorInfo& info, Visit visit) {
  const size_t element = component_bytes(info.component) * static_cast<size_t>(info.num_components);
  if (!info.decompressed.empty()) {
    const Elements all{info.decompressed.data(), element};
    for (size_t i = 0; i < info.count; ++i) visit(i, all.at(i));
    return;
  }
  if (info.json.find("bufferView")) {
    const Elements base = elements_of(d, info.json, info.count, element, true);
    for (size_t i = 0; i < info.count; ++i) visit(i, base.at(i));
  }
  const auto sparse = info.json.find("sparse");
  if (!sparse) return;
  const auto count = static_cast<size_t>(sparse->at("count").integer(1, static_cast<int64_t>(info.count)));
  const JsonView indices_json = sparse->at("indices"), type_json = indices_json.at("componentType");
  const Component type = component_of(type_json);
  if (type != Component::kUint8 && type != Component::kUint16 && type != Component::kUint32)
    type_json.fail("sparse indices must be unsigned integers (5121, 5123 or 5125)");
  // The Khronos validator refuses this too (BUFFER_VIEW_TARGET_OVERRIDE): one view cannot be vertex data and
  // a list of changes to it.
  if (const auto base = info.json.find("bufferView"))
    if (sparse->at("values").at("bufferView").json() == base->json() ||
        indices_json.at("bufferView").json() == base->json())
      sparse->fail(
          "the sparse data lies in the same buffer view as the elements it replaces; it needs one of its "
          "own");
  const Elements indices = elements_of(d, indices_json, count, component_bytes(type), false);
  const Elements values = elements_of(d, sparse->at("values"), count, element, false);
  for (size_t k = 0; k < count; ++k) {
    const size_t i = integer_at(indices.at(k), type);
    if (i >= info.count)
      indices_json.fail(fmt::format("sparse index {} is past the accessor's {} elements", i, info.count));
    visit(i, values.at(k));
  }
}

}  // namespace

size_t component_bytes(Component c) {
  switch (c) {
    case Component::kInt8:
    case Component::kUint8:
      return 1;
    case Component::kInt16:
    case Component::kUint16:
      return 2;
    case Component::kUint32:
    case Component::kFloat:
      return 4;
  }
  return 0;
}

AccessorInfo accessor_info(const SourceDocument& d, const JsonView& reference, uint64_t max_count) {
  const auto accessors = d.root().find("accessors");
  const JsonView json =
      (accessors ? *accessors
                 : d.root().at("accessors"))[reference.index(accessors ? accessors->size() : 0, "accessor")];
  AccessorInfo info{json};
  info.component = component_of(json.at("componentType"));
  info.num_components = num_components_of(json.at("type"));
  if (const auto normalized = json.find("normalized")) info.normalized = normalized->boolean();
  const JsonView count = json.at("count");
  info.count = static_cast<size_t>(count.integer(1, INT64_MAX));
  if (info.count > max_count)
    count.fail(fmt::format("{} elements are more than a file of this size can hold ({} accepted)", info.count,
                           max_count),
               ErrorCode::kLimit);
  return info;
}

std::vector<float> read_floats(const SourceDocument& d, const AccessorInfo& info) {
  const auto n = static_cast<size_t>(info.num_components);
  const size_t step = component_bytes(info.component);
  std::vector<float> out(info.count * n, 0.0f);
  for_each_element(d, info, [&](size_t i, const uint8_t* element) {
    for (size_t c = 0; c < n; ++c)
      out[i * n + c] = float_at(element + c * step, info.component, info.normalized);
  });
  return out;
}

std::vector<uint32_t> read_integers(const SourceDocument& d, const AccessorInfo& info) {
  if (info.component != Component::kUint8 && info.component != Component::kUint16 &&
      info.component != Component::kUint32)
    info.json.at("componentType").fail("expected unsigned integers (5121, 5123 or 5125)");
  const auto n = static_cast<size_t>(info.num_components);
  const size_t step = component_bytes(info.component);
  std::vector<uint32_t> out(info.count * n, 0);
  for_each_element(d, info, [&](size_t i, const uint8_t* element) {
    for (size_t c = 0; c < n; ++c) out[i * n + c] = integer_at(element + c * step, info.component);
  });
  return out;
}

}  // namespace patina::asset
