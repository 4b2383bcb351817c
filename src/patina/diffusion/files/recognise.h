// What a weight file is, told from the names and shapes of its tensors. No Torch here.
#pragma once

#include <string>

#include "patina/diffusion/files/weight_files.h"

namespace patina::diffusion {

enum class FileKind {
  kCheckpoint,  // a U-Net, with or without VAE and text encoder, under LDM's names
  kUNet,        // a U-Net alone
  kVae,
  kTextEncoder,
  kControlNet,
  kLora,
  kEmbedding,
  kOther,  // nothing patina knows
};
/// "checkpoint".
const char* name_of(FileKind kind);

struct Recognised {
  FileKind kind = FileKind::kOther;
  /// Why patina cannot use it, naming what it is: "is a Stable Diffusion XL checkpoint, …"; empty if it can.
  std::string refusal;
};

Recognised recognise(const WeightFiles& files);

/// Throws Error{kUnsupported} with the refusal, if there is one, or if the kind is another.
void require_kind(const WeightFiles& files, FileKind expected);

}  // namespace patina::diffusion
