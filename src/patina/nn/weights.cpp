#include "patina/nn/weights.h"

#include <algorithm>
#include <set>

#include <ATen/ATen.h>

#include "patina/base/error.h"

namespace patina::nn {
namespace {

at::ScalarType scalar_type(const SafeTensors& file, const TensorEntry& entry) {
  switch (entry.type) {
    case ElementType::kBool:
      return at::kBool;
    case ElementType::kU8:
      return at::kByte;
    case ElementType::kI8:
      return at::kChar;
    case ElementType::kI16:
      return at::kShort;
    case ElementType::kI32:
      return at::kInt;
    case ElementType::kI64:
      return at::kLong;
    case ElementType::kF16:
      return at::kHalf;
    case ElementType::kBF16:
      return at::kBFloat16;
    case ElementType::kF32:
      return at::kFloat;
    case ElementType::kF64:
      return at::kDouble;
    default:
      throw Error(ErrorCode::kUnsupported, file.path().string(),
                  "tensor " + printable(entry.name, 80) + " is of dtype " + std::string(name_of(entry.type)) +
                      ", which patina does not read; expected F32, F16 or BF16");
  }
}

/// "a, b, c and 12 more"
std::string list_text(const std::vector<std::string>& items) {
  constexpr size_t kShown = 8;
  std::string text;
  for (size_t i = 0; i < std::min(items.size(), kShown); ++i) text += (i ? ", " : "") + items[i];
  if (items.size() > kShown) text += " and " + std::to_string(items.size() - kShown) + " more";
  return text;
}

}  // namespace

at::Tensor read_tensor(const SafeTensors& file, const TensorEntry& entry, at::ScalarType type) {
  const at::ScalarType stored = scalar_type(file, entry);
  if (at::isFloatingType(type)) require_float(file, entry);
  if (entry.bytes.empty()) return at::empty(entry.shape, type);

  // The map is read-only; nothing writes through these tensors.
  auto* data = const_cast<uint8_t*>(entry.bytes.data());
  const auto keep_alive = [map = file.file()](void*) {};
  const bool aligned = reinterpret_cast<uintptr_t>(data) % static_cast<uintptr_t>(bytes_of(entry.type)) == 0;
  if (aligned) return at::from_blob(data, entry.shape, keep_alive, stored).to(type);

  const at::Tensor bytes =
      at::from_blob(data, {static_cast<int64_t>(entry.bytes.size())}, keep_alive, at::kByte);
  return bytes.clone().view(stored).view(entry.shape).to(type);
}

at::Tensor WeightReader::take(const std::string& name, std::vector<int64_t> shape, at::ScalarType type) {
  const at::Tensor tensor = source_.find(name, shape, type);
  if (!tensor.defined()) {
    missing_.push_back(source_.stored_name(name) + " " + shape_text(shape));
    return at::zeros(shape, type);
  }
  taken_.push_back(name);
  if (tensor.sizes() != shape) {
    misshapen_.push_back(source_.stored_name(name) + " (expected " + shape_text(shape) + ", found " +
                         shape_text(tensor.sizes()) + ")");
    return at::zeros(shape, type);
  }
  count_.parameters += tensor.numel();
  count_.bytes += static_cast<int64_t>(tensor.nbytes());
  return placement_.device.is_cpu() ? tensor : tensor.to(placement_.device);
}

void WeightReader::finish() const {
  std::string text;
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : "; ") + part; };
  if (!missing_.empty())
    add(std::to_string(missing_.size()) + " tensors are missing: " + list_text(missing_));
  if (!misshapen_.empty())
    add(std::to_string(misshapen_.size()) + " tensors have the wrong shape: " + list_text(misshapen_));
  if (text.empty()) {
    // A tensor too many means that the configuration describes another network than the weights.
    const std::set<std::string> taken(taken_.begin(), taken_.end());
    std::vector<std::string> unused;
    for (const std::string& name : source_.names()) {
      const bool known = std::any_of(ignored_.begin(), ignored_.end(),
                                     [&](const std::string& prefix) { return name.starts_with(prefix); });
      if (!known && !taken.contains(name)) unused.push_back(printable(name, 80));
    }
    if (!unused.empty()) {
      add(std::to_string(unused.size()) +
          " tensors do not belong to a network of this configuration: " + list_text(unused));
    }
  }
  if (!text.empty()) throw Error(ErrorCode::kFormat, source_.where(), text);
}

}  // namespace patina::nn
