#include "patina/diffusion/networks/dry_run.h"

#include <ATen/ATen.h>

#include "patina/base/error.h"
#include "patina/diffusion/networks/component.h"

namespace patina::diffusion {
namespace {

at::Tensor shape_only(at::IntArrayRef shape, at::ScalarType type) {
  return at::empty(shape, at::TensorOptions().dtype(type).device(at::kMeta));
}

}  // namespace

at::Tensor ShapeWeights::find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) {
  const auto found = table_.tensors.find(name);
  if (found == table_.tensors.end()) return {};
  const nn::TensorEntry& entry = found->second.entry;
  nn::require_float(*found->second.file, entry);
  return shape_only(same_but_ones(entry.shape, expected) ? expected : at::IntArrayRef(entry.shape), type);
}

std::vector<std::string> ShapeWeights::names() const {
  return TableWeights(table_).names();
}

at::Tensor WishList::find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) {
  wishes.emplace_back(name, expected.vec());
  return shape_only(expected, type);
}

}  // namespace patina::diffusion
