// The weights of a network while it is trained: f32 leaves that record gradients, the moments of Adam, and
// the moving average that is used in the end.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <ATen/core/Tensor.h>
#include <c10/core/Device.h>

#include "patina/nn/weights.h"

namespace patina::train_mini {

/// A source of weights for nn::WeightReader. What a network asks for is made and initialised by its name when
/// it is first asked for, and given as `type` by a conversion through which gradients flow back: networks are
/// built anew at each step, of numbers of any precision, and the f32 leaves stay.
class Parameters final : public nn::WeightSource {
 public:
  Parameters(std::string name, uint64_t seed, c10::Device device)
      : name_(std::move(name)), seed_(seed), device_(device) {}

  std::string where() const override { return name_; }
  bool has(const std::string& name) const override { return index_.count(name) > 0; }
  at::Tensor find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) override;
  std::vector<std::string> names() const override;

  /// While true, find() gives the moving average, without gradients.
  void use_average(bool on) { use_average_ = on; }
  /// While false, find() gives values through which no gradients reach the leaves.
  void record_gradients(bool on) { record_gradients_ = on; }

  /// A value before the first step, and another in its place.
  at::Tensor start_of(const std::string& name) const;
  void start_with(const std::string& name, const at::Tensor& value);

  struct Optimizer {
    double rate = 3e-4, beta1 = 0.9, beta2 = 0.99, epsilon = 1e-8, weight_decay = 0.01;
    double momentum = 0;     // of the orthogonalised steps of matrices; 0: AdamW for them too
    double average = 0.999;  // share of the moving average that is kept a step
    int64_t workers = 1;     // threads that orthogonalise
  };
  /// One step on the gradients gathered, which are then cleared: AdamW [Loshchilov2019], and where `momentum`
  /// asks for it Muon [Jordan2024] for the weights of hidden layers, scaled to AdamW's size of step
  /// [Liu2025].
  void step(const Optimizer& optimizer, int64_t step);
  /// √Σ g² over all gradients, and their product with `factor`.
  double gradient_norm() const;
  void scale_gradients(double factor);

  /// Begins with the weights of a trained model, as write_result() leaves them, before the first step.
  void begin_with(const std::filesystem::path& file);
  /// Everything, for going on later; read() is a no-op if there is no such file. Throws Error.
  void write(const std::filesystem::path& file) const;
  void read(const std::filesystem::path& file);
  /// The moving average as f16.
  void write_result(const std::filesystem::path& file) const;

  int64_t num_parameters() const;

 private:
  struct Entry {
    std::string name;
    at::Tensor value, first_moment, second_moment, average;
  };
  Entry& add(const std::string& name, const at::Tensor& value);

  std::string name_;
  uint64_t seed_;
  c10::Device device_;
  bool use_average_ = false, record_gradients_ = true;
  std::vector<Entry> entries_;
  std::map<std::string, size_t> index_;
};

/// The type that trainings compute in: bf16 on a GPU and where the processor multiplies it, else f32. Weights
/// stay f32.
at::ScalarType training_type(c10::Device device);

}  // namespace patina::train_mini
