#include "patina/nn/file_weights.h"

namespace patina::nn {

at::Tensor FileWeights::find(const std::string& name, at::IntArrayRef, at::ScalarType type) {
  const TensorEntry* entry = file_.find(name);
  return entry ? read_tensor(file_, *entry, type) : at::Tensor();
}

std::vector<std::string> FileWeights::names() const {
  std::vector<std::string> names;
  for (const TensorEntry& entry : file_.tensors()) names.push_back(entry.name);
  return names;
}

}  // namespace patina::nn
