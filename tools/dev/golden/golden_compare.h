// What the golden cases share: reading stored tensors, comparing with them, and the model's parts, loaded
// when first needed.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "dev/golden/golden.h"
#include "patina/diffusion/model_state.h"
#include "patina/nn/safetensors.h"

namespace patina::diffusion::golden {

/// Largest difference that is allowed: absolute + relative · max|expected|.
struct Limit {
  double absolute, relative;
};
// The limits that the reference data suggests for f32; float64 reruns of the reference itself stay below a
// quarter of them.
inline constexpr Limit kModuleLimit{5e-5, 2e-5};
inline constexpr Limit kEndToEndLimit{5e-4, 1e-4};
inline constexpr Limit kEmbeddingLimit{1e-4, 0};

/// Gathers comparisons; the result is the one nearest to (or furthest past) its limit.
class Comparison {
 public:
  explicit Comparison(std::string name) { result_.name = std::move(name); }

  /// Shapes must agree, but tokens [B,H·W,C] and images [B,C,H,W] count as one layout.
  void add(const std::string& tensor, const at::Tensor& found, const at::Tensor& expected, Limit limit);
  void fail(std::string why);
  GoldenResult result() const { return result_; }

 private:
  GoldenResult result_;
};

/// The stored tensors of one file; floating types as f32, integers as int64.
class Stored {
 public:
  explicit Stored(const std::filesystem::path& path) : file_(path) {}
  bool has(const std::string& name) const { return file_.find(name) != nullptr; }
  /// Throws Error{kFormat} naming the tensor if there is none.
  at::Tensor operator[](const std::string& name) const;
  std::vector<std::string> names(const std::string& prefix) const;
  bool has_metadata(const std::string& key) const { return file_.metadata().contains(key); }
  /// Throws Error{kFormat} if the file's metadata lacks `key`.
  std::string metadata(const std::string& key) const;

 private:
  nn::SafeTensors file_;
};

/// The parts of a model folder, in f32.
class Parts {
 public:
  explicit Parts(std::filesystem::path folder) : folder_(std::move(folder)) {}
  const std::filesystem::path& folder() const { return folder_; }
  const Tokenizer& tokenizer();
  const TextEncoder& text_encoder();
  const UNet& unet();
  const Vae& vae();
  const Held<ControlNet>& controlnet(const std::string& name);  // <folder>/controlnet_<name>

 private:
  std::filesystem::path folder_;
  std::optional<Tokenizer> tokenizer_;
  std::optional<TextEncoder> text_encoder_;
  std::optional<UNet> unet_;
  std::optional<Vae> vae_;
  std::map<std::string, Held<ControlNet>> controlnets_;
};

/// Trajectories of one scheduler variant; `folder` holds index.json and inputs.safetensors beside the file.
void check_scheduler(const std::filesystem::path& file, Comparison& comparison);
/// Whole runs.
void check_text_to_image(const Stored& stored, Parts& parts, Comparison& comparison);
void check_image_to_image(const Stored& stored, Parts& parts, Comparison& comparison);

}  // namespace patina::diffusion::golden
