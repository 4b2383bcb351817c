// From weight files to tensors: each tensor is asked for by name and expected shape, and every mismatch of a
// whole network is reported at once.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <ATen/core/Tensor.h>

#include "patina/nn/safetensors.h"

namespace patina::nn {

/// The tensor as the file holds it. Where dtype and alignment allow it lies in the map, without a copy, and
/// keeps the map alive; else it is one conversion. Throws Error{kUnsupported} for elements that are no F32,
/// F16, BF16 or F64 if `type` is a floating type (require_float); otherwise integers become `type` too.
at::Tensor read_tensor(const SafeTensors& file, const TensorEntry& entry, at::ScalarType type);

/// Where the tensors of a network come from.
class WeightSource {
 public:
  virtual ~WeightSource() = default;
  /// For messages: the file.
  virtual std::string where() const = 0;
  virtual bool has(const std::string& name) const = 0;
  /// The tensor as `type` in the shape it is stored in; undefined if there is none. `expected` is the shape
  /// that the network asks for.
  virtual at::Tensor find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) = 0;
  virtual std::vector<std::string> names() const = 0;
  /// For messages: the name under which the file holds (or would hold) the tensor.
  virtual std::string stored_name(const std::string& name) const { return name; }
};

/// What tensors become, and where.
struct Placement {
  at::ScalarType type;
  c10::Device device;
  /// Weights are kept in no form that is faster and larger.
  bool low_memory;

  Placement(at::ScalarType t, c10::Device d = c10::kCPU, bool low = false)
      : type(t), device(d), low_memory(low) {}
};

/// How large a network is.
struct WeightCount {
  int64_t parameters = 0;
  int64_t bytes = 0;  // in memory
};

/// Hands out the tensors of one network and keeps account of what does not fit.
///
/// take() never fails at once: what is missing or wrongly shaped is noted and zeros are returned, so that
/// finish() can name all of it in one message.
class WeightReader {
 public:
  /// Tensors become this type and go to this device; with the processor as device they stay where the
  /// source gives them. `source` must outlive the reader, not the tensors.
  WeightReader(WeightSource& source, Placement placement) : source_(source), placement_(placement) {}

  at::Tensor take(const std::string& name, std::vector<int64_t> shape) {
    return take(name, std::move(shape), placement_.type);
  }
  at::Tensor take(const std::string& name, std::vector<int64_t> shape, at::ScalarType type);
  bool has(const std::string& name) const { return source_.has(name); }
  at::ScalarType type() const { return placement_.type; }
  bool low_memory() const { return placement_.low_memory; }
  /// Of all that was taken.
  const WeightCount& count() const { return count_; }
  /// A layer keeps what it took in a form that is larger by so many bytes.
  void add_bytes(int64_t bytes) { count_.bytes += bytes; }

  /// Names that begin so may be in the file unused (position ids, training leftovers).
  void ignore(std::string prefix) { ignored_.push_back(std::move(prefix)); }
  /// Throws Error{kFormat} that names missing tensors (with the expected shape), wrong shapes (expected and
  /// found) and, where nothing else is wrong, tensors that the configuration does not call for.
  void finish() const;

 private:
  WeightSource& source_;
  Placement placement_;
  WeightCount count_;
  std::vector<std::string> taken_, ignored_, missing_, misshapen_;
};

}  // namespace patina::nn
