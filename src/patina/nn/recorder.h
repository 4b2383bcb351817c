// Records the outputs of a network's modules under their diffusers paths. Without a recorder it costs a test
// of one pointer.
#pragma once

#include <functional>
#include <string>

#include <ATen/core/Tensor.h>

namespace patina::nn {

class Recorder {
 public:
  using Sink = std::function<void(const std::string& module_path, const at::Tensor& output)>;

  Recorder() = default;
  explicit Recorder(Sink sink) : sink_(std::move(sink)) {}

  bool listens() const { return static_cast<bool>(sink_); }

  /// Passes `output` through.
  const at::Tensor& operator()(const std::string& module_path, const at::Tensor& output) const {
    if (sink_) sink_(module_path, output);
    return output;
  }

 private:
  Sink sink_;
};

}  // namespace patina::nn
