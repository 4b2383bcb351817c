#include "patina/diffusion/component.h"

#include <ATen/ATen.h>

namespace patina::diffusion {
namespace {

at::Tensor read_f32(const StoredTensor& tensor) {
  return nn::read_tensor(*tensor.file, tensor.entry, at::kFloat);
}

/// B A, or B (core · A) where there is a core, in the shape of the weight.
at::Tensor product(const LoraDelta& delta, at::IntArrayRef shape) {
  const at::Tensor down = read_f32(delta.down), up = read_f32(delta.up);
  const int64_t rank = down.size(0);
  const at::Tensor rows = up.reshape({shape[0], rank});
  if (!delta.mid) return at::matmul(rows, down.reshape({rank, -1})).reshape(shape);
  // core [rank, rank, k, k]: its first axis meets B, its second A.
  const at::Tensor mid = read_f32(*delta.mid), columns = down.reshape({rank, -1});
  const at::Tensor inner = at::matmul(mid.permute({0, 2, 3, 1}), columns);  // [rank, k, k, in]
  const at::Tensor whole = at::matmul(rows, inner.reshape({rank, -1}));     // [out, k·k·in]
  return whole.reshape({shape[0], mid.size(2), mid.size(3), columns.size(1)})
      .permute({0, 3, 1, 2})
      .reshape(shape);
}

}  // namespace

bool same_but_ones(at::IntArrayRef a, at::IntArrayRef b) {
  const at::IntArrayRef longer = a.size() > b.size() ? a : b, shorter = a.size() > b.size() ? b : a;
  for (size_t i = 0; i < longer.size(); ++i) {
    if (longer[i] != (i < shorter.size() ? shorter[i] : 1)) return false;
  }
  return true;
}

at::Tensor TableWeights::find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) {
  const auto found = table_.tensors.find(name);
  if (found == table_.tensors.end()) return {};
  const auto deltas = deltas_ ? deltas_->find(name) : LoraDeltas::const_iterator{};
  const bool changed = deltas_ && deltas != deltas_->end();

  at::Tensor tensor = nn::read_tensor(*found->second.file, found->second.entry, changed ? at::kFloat : type);
  // Some tools store the 1×1 convolutions of other tools as linear layers, or the other way round.
  if (tensor.sizes() != expected && same_but_ones(tensor.sizes(), expected))
    tensor = tensor.reshape(expected);
  // A vector that lies in the map would keep the map of a whole checkpoint alive after its matrices were
  // converted.
  if (tensor.dim() == 1) tensor = tensor.clone();
  if (!changed) return tensor;
  for (const LoraDelta& delta : deltas->second)
    tensor = tensor + delta.scale * product(delta, tensor.sizes());
  return tensor.to(type);
}

std::vector<std::string> TableWeights::names() const {
  std::vector<std::string> names = table_.unknown;
  for (const auto& [name, tensor] : table_.tensors) names.push_back(name);
  return names;
}

}  // namespace patina::diffusion
