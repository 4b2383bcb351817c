#include "parameters.h"

#include <cmath>

#include <ATen/ATen.h>
#include <ATen/CPUGeneratorImpl.h>
#include <c10/core/GradMode.h>
#include <torch/version.h>

#include "patina/base/bf16.h"
#include "patina/base/error.h"
#include "workers.h"

namespace patina::train_mini {
namespace {

/// Of layers that a network starts without: residual branches add nothing at first.
constexpr double kResidualScale = 0.1;
/// Of the attention to the words, which must not begin in a whisper.
constexpr double kWordsScale = 0.5;
/// Steps between two updates of the moving average.
constexpr int64_t kAverageInterval = 4;

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// Values before training, by the name of the layer.
at::Tensor initial(const std::string& name, at::IntArrayRef shape, uint64_t seed) {
  if (ends_with(name, ".bias")) return at::zeros(shape);
  if (shape.size() == 1) return at::ones(shape);  // gains of the norms
  const at::Tensor normal = at::randn(shape, at::make_generator<at::CPUGeneratorImpl>(seed));
  if (ends_with(name, "embedding.weight")) return normal * 0.02;
  int64_t fan_in = 1;
  for (size_t axis = 1; axis < shape.size(); ++axis) fan_in *= shape[axis];
  double scale = 1 / std::sqrt(static_cast<double>(fan_in));
  for (const char* last : {".conv2.weight", ".proj_out.weight", ".to_out.0.weight", ".net.2.weight",
                           ".out_proj.weight", ".fc2.weight", "conv_out.weight"}) {
    if (ends_with(name, last))
      scale *= name.find(".attn2.") != std::string::npos ? kWordsScale : kResidualScale;
  }
  if (name.find("controlnet_down_blocks") == 0 || name.find("controlnet_mid_block") == 0)
    scale *= kResidualScale;
  if (name == "controlnet_cond_embedding.conv_out.weight") scale /= kResidualScale;
  return normal * scale;
}

nn::TensorEntry entry_of(const std::string& name, const at::Tensor& tensor) {
  return {name,
          tensor.scalar_type() == at::kHalf ? nn::ElementType::kF16 : nn::ElementType::kF32,
          tensor.sizes().vec(),
          {static_cast<const uint8_t*>(tensor.data_ptr()), static_cast<size_t>(tensor.nbytes())}};
}

void write_tensors(const std::filesystem::path& file,
                   const std::vector<std::pair<std::string, at::Tensor>>& tensors) {
  std::vector<nn::TensorEntry> entries;
  for (const auto& [name, tensor] : tensors) entries.push_back(entry_of(name, tensor));
  nn::write_safetensors(file, entries);
}

using Tensors = std::vector<at::Tensor>;

/// AdamW [Loshchilov2019]; `count` steps with this one.
void adamw_step(Tensors& values, const Tensors& gradients, Tensors& firsts, Tensors& seconds,
                const Parameters::Optimizer& adam, double count) {
#if TORCH_VERSION_MAJOR >= 2
  const Tensors counts(values.size(), at::full({}, count, values[0].options()));
  at::_fused_adamw_(values, gradients, firsts, seconds, {}, counts, adam.rate, adam.beta1, adam.beta2,
                    adam.weight_decay, adam.epsilon, /*amsgrad=*/false, /*maximize=*/false);
#else
  at::_foreach_mul_(values, 1 - adam.rate * adam.weight_decay);
  at::_foreach_mul_(firsts, adam.beta1);
  at::_foreach_add_(firsts, gradients, 1 - adam.beta1);
  at::_foreach_mul_(seconds, adam.beta2);
  at::_foreach_addcmul_(seconds, gradients, gradients, 1 - adam.beta2);
  Tensors scales = at::_foreach_sqrt(seconds);
  at::_foreach_div_(scales, std::sqrt(1 - std::pow(adam.beta2, count)));
  at::_foreach_add_(scales, adam.epsilon);
  at::_foreach_addcdiv_(values, firsts, scales, -adam.rate / (1 - std::pow(adam.beta1, count)));
#endif
}

/// Whether a weight multiplies vectors of a hidden layer, so that its step is one of a matrix.
bool is_hidden_matrix(const std::string& name, const at::Tensor& value) {
  constexpr int64_t kLeastSide = 16;
  if (value.dim() < 2 || value.size(0) < kLeastSide || value[0].numel() < kLeastSide) return false;
  for (const char* outer : {"embedding", "conv_in.", "conv_out."})
    if (name.find(outer) != std::string::npos) return false;
  return true;
}

/// About U Vᵀ of the singular value decomposition U S Vᵀ of `matrix` [R,C], by five Newton-Schulz iterations
/// [Jordan2024].
at::Tensor orthogonalised(const at::Tensor& matrix) {
  const bool tall = matrix.size(0) > matrix.size(1);
  at::Tensor x = (tall ? matrix.t() : matrix).to(training_type(matrix.device())).contiguous();
  x = x / (x.norm() + 1e-7);
  for (int i = 0; i < 5; ++i) {
    const at::Tensor square = at::mm(x, x.t());
    const at::Tensor polynomial = at::addmm(square, square, square, -4.7750, 2.0315);
    x = at::addmm(x, polynomial, x, 3.4445, 1.0);
  }
  return (tall ? x.t() : x).to(at::kFloat);
}

/// One step of Muon [Jordan2024] with Nesterov's momentum; the root mean square of a step is 0.2 times the
/// rate, as AdamW's tends to be [Liu2025].
void muon_step(const at::Tensor& value, const at::Tensor& gradient, at::Tensor moment,
               const Parameters::Optimizer& optimizer) {
  moment.mul_(optimizer.momentum).add_(gradient);
  const at::Tensor matrix = gradient.add(moment, optimizer.momentum).flatten(1);
  const double scale = 0.2 * std::sqrt(static_cast<double>(std::max(matrix.size(0), matrix.size(1))));
  value.mul_(1 - optimizer.rate * optimizer.weight_decay);
  value.sub_(orthogonalised(matrix).view_as(value), optimizer.rate * scale);
}

at::Tensor host_copy(const at::Tensor& tensor, at::ScalarType type = at::kFloat) {
  return tensor.detach().to(at::kCPU, type).contiguous();
}

}  // namespace

Parameters::Entry& Parameters::add(const std::string& name, const at::Tensor& value) {
  const c10::NoGradGuard no_gradients;
  const at::Tensor placed = value.to(device_, at::kFloat).contiguous();
  index_[name] = entries_.size();
  entries_.push_back({name, placed.clone().set_requires_grad(true), at::zeros_like(placed),
                      at::zeros_like(placed), placed.clone()});
  return entries_.back();
}

at::Tensor Parameters::find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) {
  const auto found = index_.find(name);
  const Entry& entry = found != index_.end() ? entries_[found->second]
                                             : add(name, initial(name, expected, seed_ + entries_.size()));
  const at::Tensor& chosen = use_average_ ? entry.average : entry.value;
  return (record_gradients_ ? chosen : chosen.detach()).to(type);
}

std::vector<std::string> Parameters::names() const {
  std::vector<std::string> names;
  for (const Entry& entry : entries_) names.push_back(entry.name);
  return names;
}

at::Tensor Parameters::start_of(const std::string& name) const {
  return entries_[index_.at(name)].value.detach();
}

void Parameters::start_with(const std::string& name, const at::Tensor& value) {
  const c10::NoGradGuard no_gradients;
  Entry& entry = entries_[index_.at(name)];
  entry.value.copy_(value);
  entry.average.copy_(value);
}

void Parameters::step(const Optimizer& optimizer, int64_t step) {
  const c10::NoGradGuard no_gradients;
  std::vector<at::Tensor> values, gradients, firsts, seconds, averages, stepped;
  std::vector<Entry*> matrices;
  for (Entry& entry : entries_) {
    if (!entry.value.grad().defined()) continue;
    stepped.push_back(entry.value), averages.push_back(entry.average);
    if (optimizer.momentum > 0 && is_hidden_matrix(entry.name, entry.value)) {
      matrices.push_back(&entry);
      continue;
    }
    values.push_back(entry.value), gradients.push_back(entry.value.grad());
    firsts.push_back(entry.first_moment), seconds.push_back(entry.second_moment);
  }
  if (!values.empty())
    adamw_step(values, gradients, firsts, seconds, optimizer, static_cast<double>(step + 1));
  if (!matrices.empty()) {
    const auto count = static_cast<int64_t>(matrices.size());
    in_shares(optimizer.workers, optimizer.workers, [&](int64_t begin, int64_t) {
      const c10::NoGradGuard none;  // a thread's own
      for (int64_t i = begin; i < count; i += optimizer.workers) {
        Entry& entry = *matrices[static_cast<size_t>(i)];
        muon_step(entry.value, entry.value.grad(), entry.first_moment, optimizer);
      }
    });
  }
  if (stepped.empty()) return;
  if (step % kAverageInterval == 0) {
    // Early averages forget faster, so that the first steps leave no trace.
    const double kept = std::min(std::pow(optimizer.average, kAverageInterval),
                                 (1 + static_cast<double>(step)) / (10 + static_cast<double>(step)));
    at::_foreach_mul_(averages, kept);
    at::_foreach_add_(averages, stepped, 1 - kept);
  }
  for (Entry& entry : entries_) entry.value.mutable_grad() = at::Tensor();
}

double Parameters::gradient_norm() const {
  const c10::NoGradGuard no_gradients;
  std::vector<at::Tensor> norms;
  for (const Entry& entry : entries_) {
    if (entry.value.grad().defined()) norms.push_back(entry.value.grad().norm());
  }
  return norms.empty() ? 0.0 : at::stack(norms).norm().item<double>();
}

void Parameters::scale_gradients(double factor) {
  const c10::NoGradGuard no_gradients;
  for (Entry& entry : entries_) {
    if (entry.value.grad().defined()) entry.value.mutable_grad().mul_(factor);
  }
}

void Parameters::write(const std::filesystem::path& file) const {
  std::vector<std::pair<std::string, at::Tensor>> tensors;
  for (const Entry& entry : entries_) {
    tensors.emplace_back(entry.name, host_copy(entry.value));
    tensors.emplace_back(entry.name + "|first", host_copy(entry.first_moment));
    tensors.emplace_back(entry.name + "|second", host_copy(entry.second_moment));
    tensors.emplace_back(entry.name + "|average", host_copy(entry.average));
  }
  write_tensors(file, tensors);
}

void Parameters::read(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return;
  const nn::SafeTensors stored(file);
  const auto tensor = [&](const std::string& name) {
    const nn::TensorEntry* entry = stored.find(name);
    if (!entry)
      throw Error(ErrorCode::kFormat, file.string(),
                  "lacks " + name + "; it is no checkpoint of the trainer");
    return nn::read_tensor(stored, *entry, at::kFloat).to(device_).clone();
  };
  for (const nn::TensorEntry& stored_entry : stored.tensors()) {
    const std::string& name = stored_entry.name;
    if (name.find('|') != std::string::npos) continue;
    Entry& entry = add(name, tensor(name));
    entry.first_moment = tensor(name + "|first");
    entry.second_moment = tensor(name + "|second");
    entry.average = tensor(name + "|average");
  }
}

void Parameters::begin_with(const std::filesystem::path& file) {
  const nn::SafeTensors stored(file);
  for (const nn::TensorEntry& entry : stored.tensors())
    add(entry.name, nn::read_tensor(stored, entry, at::kFloat));
}

void Parameters::write_result(const std::filesystem::path& file) const {
  std::vector<std::pair<std::string, at::Tensor>> tensors;
  for (const Entry& entry : entries_) tensors.emplace_back(entry.name, host_copy(entry.average, at::kHalf));
  write_tensors(file, tensors);
}

int64_t Parameters::num_parameters() const {
  int64_t count = 0;
  for (const Entry& entry : entries_) count += entry.value.numel();
  return count;
}

at::ScalarType training_type(c10::Device device) {
  return device.is_cuda() || multiplies_bf16() ? at::kBFloat16 : at::kFloat;
}

}  // namespace patina::train_mini
