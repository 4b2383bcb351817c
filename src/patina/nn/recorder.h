// A tap on the inside of a network: every module hands its output to the recorder under its diffusers path.
// Costs a test of one pointer where nobody listens.
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
