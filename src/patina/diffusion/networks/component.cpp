#include "patina/diffusion/networks/component.h"

#include <sys/mman.h>
#include <unistd.h>

#include <ATen/ATen.h>

namespace patina::diffusion {
namespace {

/// Gives back the memory of a tensor's whole pages in the map: they were read once, for a conversion, and
/// would stand beside what they became until the whole file is loaded. Whoever reads them again gets them
/// again.
void release_pages(std::span<const uint8_t> bytes) {
  const auto page = static_cast<uintptr_t>(::sysconf(_SC_PAGESIZE));
  const uintptr_t begin = (reinterpret_cast<uintptr_t>(bytes.data()) + page - 1) / page * page;
  const uintptr_t end = (reinterpret_cast<uintptr_t>(bytes.data()) + bytes.size()) / page * page;
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_DONTNEED);
}

bool lies_in(const at::Tensor& tensor, std::span<const uint8_t> bytes) {
  const auto* data = static_cast<const uint8_t*>(tensor.data_ptr());
  return data >= bytes.data() && data < bytes.data() + bytes.size();
}

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

void release_pages(const TensorTable& table) {
  for (const auto& [name, tensor] : table.tensors) release_pages(tensor.entry.bytes);
}

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
  if (changed) {
    for (const LoraDelta& delta : deltas->second)
      tensor = tensor + delta.scale * product(delta, tensor.sizes());
    tensor = tensor.to(type);
  }
  if (!lies_in(tensor, found->second.entry.bytes)) release_pages(found->second.entry.bytes);
  return tensor;
}

std::vector<std::string> TableWeights::names() const {
  std::vector<std::string> names = table_.unknown;
  for (const auto& [name, tensor] : table_.tensors) names.push_back(name);
  return names;
}

}  // namespace patina::diffusion
