// A weight file whose tensors bear the names that the network asks for.
#pragma once

#include <string>
#include <vector>

#include "patina/nn/weights.h"

namespace patina::nn {

/// `file` must outlive it, not the tensors.
class FileWeights final : public WeightSource {
 public:
  explicit FileWeights(const SafeTensors& file) : file_(file) {}
  std::string where() const override { return file_.path().string(); }
  bool has(const std::string& name) const override { return file_.find(name) != nullptr; }
  at::Tensor find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) override;
  std::vector<std::string> names() const override;

 private:
  const SafeTensors& file_;
};

}  // namespace patina::nn
