#include "patina/diffusion/files/network_part.h"

#include "patina/base/error.h"
#include "patina/diffusion/files/infer_config.h"
#include "patina/diffusion/files/recognise.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;

/// Files of the folders of other tools lie side by side, so a config.json there belongs to nobody in
/// particular, unless the file is called as diffusers calls it.
bool has_own_config(const fs::path& file) {
  const std::string name = file.filename().string();
  return fs::exists(file.parent_path() / "config.json") &&
         (name.starts_with("diffusion_pytorch_model.") || name.starts_with("model."));
}

FileKind kind_of(Network network) {
  switch (network) {
    case Network::kUNet:
      return FileKind::kUNet;
    case Network::kVae:
      return FileKind::kVae;
    case Network::kTextEncoder:
      return FileKind::kTextEncoder;
    case Network::kControlNet:
      break;
  }
  return FileKind::kControlNet;
}

template <class Config>
NetworkPart<Config> open(const fs::path& path, Network network, Config (*read)(const fs::path&),
                         Config (*infer)(const TensorTable&)) {
  nn::refuse_pickle_name(path);
  if (!fs::exists(path))
    throw Error(ErrorCode::kNotFound, path.string(),
                std::string("does not exist; expected a ") + name_of(network) +
                    ": the folder of a diffusers component or a .safetensors file");
  const bool configured = fs::is_directory(path) || has_own_config(path);
  std::optional<Config> config;
  if (configured) config = read(fs::is_directory(path) ? path : path.parent_path());
  const WeightFiles files = open_weight_files(path);
  if (!configured) require_kind(files, kind_of(network));
  std::optional<TensorTable> table = find_network(files, network);
  if (!table)
    throw Error(ErrorCode::kFormat, files.files.front()->path().string(),
                std::string("holds no ") + name_of(network) +
                    " under diffusers' or LDM's names, which was expected here");
  table->where = files.files.size() == 1 ? files.files.front()->path() : path;
  if (!config) config = infer(*table);
  return {std::move(*table), std::move(*config)};
}

}  // namespace

UNetPart open_unet(const fs::path& path) {
  return open(path, Network::kUNet, read_unet_config, infer_unet_config);
}
VaePart open_vae(const fs::path& path) {
  return open(path, Network::kVae, read_vae_config, infer_vae_config);
}
TextEncoderPart open_text_encoder(const fs::path& path) {
  return open(path, Network::kTextEncoder, read_text_encoder_config, infer_text_encoder_config);
}
ControlNetPart open_controlnet(const fs::path& path) {
  return open(path, Network::kControlNet, read_controlnet_config, infer_controlnet_config);
}

}  // namespace patina::diffusion
