#include "patina/diffusion/files/lora.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/diffusion/files/embedding.h"
#include "patina/diffusion/files/recognise.h"

namespace patina::diffusion {
namespace {

enum class Role { kDown, kUp, kMid, kAlpha };
struct Suffix {
  const char* text;
  Role role;
};
// Of tensor names. The first that fits counts, so what ends like another stands before it.
constexpr std::array kSuffixes{Suffix{".lora_down.weight", Role::kDown},
                               Suffix{".lora_up.weight", Role::kUp},
                               Suffix{".lora_mid.weight", Role::kMid},
                               Suffix{".alpha", Role::kAlpha},
                               Suffix{".lora_A.weight", Role::kDown},
                               Suffix{".lora_B.weight", Role::kUp},
                               Suffix{".lora_A.default.weight", Role::kDown},
                               Suffix{".lora_B.default.weight", Role::kUp},
                               Suffix{".lora_linear_layer.down.weight", Role::kDown},
                               Suffix{".lora_linear_layer.up.weight", Role::kUp},
                               Suffix{".lora.down.weight", Role::kDown},
                               Suffix{".lora.up.weight", Role::kUp},
                               Suffix{"_lora.down.weight", Role::kDown},
                               Suffix{"_lora.up.weight", Role::kUp}};

/// The tensors of one module of a LoRA file.
struct Module {
  std::optional<StoredTensor> down, up, mid, alpha;
  std::string first_tensor;  // for messages
};

std::string replaced(std::string text, std::string_view what, std::string_view by) {
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
  return text;
}

/// kohya writes module paths with underscores for dots; in that form all namings meet.
std::string flat(std::string path) {
  std::replace(path.begin(), path.end(), '.', '_');
  return path;
}

/// Weights of a network by the flat names that LoRAs use for their modules.
using FlatNames = std::map<std::string, std::string, std::less<>>;

FlatNames flat_names(const TensorTable& table, const NameMap& ldm) {
  FlatNames names;
  for (const auto& [name, tensor] : table.tensors) {
    if (!name.ends_with(".weight") || tensor.entry.shape.size() < 2) continue;
    const std::string module = name.substr(0, name.size() - std::string_view(".weight").size());
    names.emplace(flat(module), name);
    if (const auto original = ldm.to_ldm(module)) names.emplace(flat(*original), name);
    // The first attention processors of diffusers had no ".0" behind "to_out".
    if (module.ends_with(".to_out.0")) names.emplace(flat(module.substr(0, module.size() - 2)), name);
  }
  return names;
}

double half_value(uint16_t bits) {
  const int exponent = bits >> 10 & 31, mantissa = bits & 1023;
  const double magnitude =
      exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
  return bits >> 15 ? -magnitude : magnitude;
}

/// The value of a tensor of one element.
double scalar(const StoredTensor& tensor) {
  const nn::TensorEntry& entry = tensor.entry;
  const auto bytes_as = [&]<class T>(T value) {
    std::memcpy(&value, entry.bytes.data(), sizeof value);
    return value;
  };
  double value = std::nan("");
  if (entry.num_elements() == 1) {
    switch (entry.type) {
      case nn::ElementType::kF32:
        value = static_cast<double>(bytes_as(float{}));
        break;
      case nn::ElementType::kF64:
        value = bytes_as(double{});
        break;
      case nn::ElementType::kF16:
        value = half_value(bytes_as(uint16_t{}));
        break;
      case nn::ElementType::kBF16:
        value = static_cast<double>(std::bit_cast<float>(static_cast<uint32_t>(bytes_as(uint16_t{})) << 16));
        break;
      case nn::ElementType::kI64:
        value = static_cast<double>(bytes_as(int64_t{}));
        break;
      case nn::ElementType::kI32:
        value = bytes_as(int32_t{});
        break;
      default:
        break;
    }
  }
  if (!std::isfinite(value))
    throw Error(ErrorCode::kFormat, tensor.file->path().string(),
                "tensor " + printable(entry.name, 100) + " of shape " + nn::shape_text(entry.shape) + " " +
                    std::string(nn::name_of(entry.type)) + " is not one finite number, as an alpha must be");
  return value;
}

/// The file's tensors by module: under the prefix of their network and the module's flat name.
std::map<std::string, Module> modules_of(const WeightFiles& files) {
  std::map<std::string, Module> modules;
  for (const auto& [name, tensor] : files.tensors) {
    if (name.starts_with(kBundledEmbedding)) continue;  // a learned word, see embedding.h
    const auto suffix = std::find_if(kSuffixes.begin(), kSuffixes.end(),
                                     [&](const Suffix& s) { return name.ends_with(s.text); });
    if (suffix == kSuffixes.end())
      throw Error(
          ErrorCode::kUnsupported, files.where.string(),
          "tensor '" + printable(name, 100) +
              "' is no part of a LoRA that patina knows; expected names that end in lora_down.weight, "
              "lora_up.weight, lora_A.weight, lora_B.weight or alpha");
    std::string path = name.substr(0, name.size() - std::string_view(suffix->text).size());
    path = replaced(std::move(path), ".processor.", ".");
    if (path.starts_with("base_model.model."))
      path = path.substr(std::string_view("base_model.model.").size());
    Module& module = modules[flat(path)];
    module.first_tensor = name;
    std::optional<StoredTensor>& slot = suffix->role == Role::kDown  ? module.down
                                        : suffix->role == Role::kUp  ? module.up
                                        : suffix->role == Role::kMid ? module.mid
                                                                     : module.alpha;
    if (slot)
      throw Error(ErrorCode::kFormat, files.where.string(),
                  "tensors '" + printable(slot->entry.name, 100) + "' and '" + printable(name, 100) +
                      "' stand for the same part of one module");
    slot = tensor;
  }
  return modules;
}

/// Throws unless the product has the shape of the weight.
void check_shapes(const WeightFiles& files, const Module& module, const StoredTensor& weight) {
  const std::vector<int64_t>&down = module.down->entry.shape, &up = module.up->entry.shape,
        &target = weight.entry.shape;
  const int64_t rank = down.empty() ? 0 : down[0], out = target[0];
  int64_t inner = weight.entry.num_elements() / std::max<int64_t>(out, 1), kernel = 1;
  bool fits = rank > 0 && up.size() >= 2 && up[0] == out && up[1] == rank &&
              module.up->entry.num_elements() == out * rank;
  if (module.mid) {
    const std::vector<int64_t>& mid = module.mid->entry.shape;
    fits = fits && mid.size() == 4 && mid[0] == rank && mid[1] == rank && target.size() == 4;
    if (fits) kernel = mid[2] * mid[3], fits = mid[2] == target[2] && mid[3] == target[3];
    if (fits) inner /= kernel;
  }
  fits = fits && module.down->entry.num_elements() == rank * inner;
  if (!fits)
    throw Error(ErrorCode::kFormat, files.where.string(),
                "tensors " + printable(module.down->entry.name, 100) + " " + nn::shape_text(down) + " and " +
                    printable(module.up->entry.name, 100) + " " + nn::shape_text(up) +
                    " make no change of the weight " + printable(weight.entry.name, 100) + " " +
                    nn::shape_text(target) + "; the LoRA was made for another family of models");
}

/// PEFT's alphas where a file of diffusers tells them, else none: alpha = rank.
std::optional<double> metadata_scale(const WeightFiles& files, const std::string& network) {
  for (const auto& file : files.files) {
    const auto found = file->metadata().find("lora_adapter_metadata");
    if (found == file->metadata().end()) continue;
    const nlohmann::json json = nlohmann::json::parse(found->second, nullptr, /*allow_exceptions=*/false);
    const std::string alpha = network + ".lora_alpha", rank = network + ".r";
    if (json.is_object() && json.contains(alpha) && json.contains(rank) && json[alpha].is_number() &&
        json[rank].is_number() && json[rank].get<double>() > 0)
      return json[alpha].get<double>() / json[rank].get<double>();
  }
  return std::nullopt;
}

/// A network that a LoRA may change.
struct Target {
  const TensorTable* table;
  FlatNames names;
  std::vector<std::string> prefixes;  // of its modules' flat names
  std::string metadata;               // its name in the metadata of diffusers' files
};

/// The weight that a module changes.
struct Match {
  size_t target;     // index of its network
  std::string name;  // by diffusers
  const StoredTensor* weight;
};
std::optional<Match> find_module(const std::vector<Target>& targets, const std::string& path) {
  // Old files of diffusers name modules of the U-Net without a prefix.
  for (const bool bare : {false, true}) {
    for (size_t i = 0; i < targets.size(); ++i) {
      const Target& target = targets[i];
      for (const std::string& prefix : bare ? std::vector<std::string>{""} : target.prefixes) {
        if (!path.starts_with(prefix)) continue;
        const auto name = target.names.find(path.substr(prefix.size()));
        if (name == target.names.end()) continue;
        return Match{i, name->second, &target.table->tensors.find(name->second)->second};
      }
    }
  }
  return std::nullopt;
}

/// Adds the file's products to `deltas`, one map a target.
void match_lora(std::vector<LoraDeltas>& deltas, const LoraChoice& choice,
                const std::vector<Target>& targets) {
  const WeightFiles files = open_weight_files(choice.file);
  require_kind(files, FileKind::kLora);
  std::vector<std::optional<double>> scales;
  for (const Target& target : targets) scales.push_back(metadata_scale(files, target.metadata));
  std::vector<std::string> strangers;
  for (const auto& [path, module] : modules_of(files)) {
    const std::optional<Match> match = find_module(targets, path);
    if (!match) {
      strangers.push_back(printable(module.first_tensor, 100));
      continue;
    }
    if (!module.down || !module.up)
      throw Error(ErrorCode::kFormat, files.where.string(),
                  "tensor '" + printable(module.first_tensor, 100) +
                      "' has no counterpart; expected both lora_down and lora_up (or lora_A and lora_B)");
    for (const std::optional<StoredTensor>* part : {&module.down, &module.up, &module.mid})
      if (*part) nn::require_float(*(*part)->file, (*part)->entry);
    check_shapes(files, module, *match->weight);
    const double rank = static_cast<double>(module.down->entry.shape[0]);
    const double scale = module.alpha ? scalar(*module.alpha) / rank : scales[match->target].value_or(1.0);
    deltas[match->target][match->name].push_back(
        {*module.down, *module.up, module.mid, static_cast<double>(choice.weight) * scale});
  }
  if (!strangers.empty()) {
    throw Error(ErrorCode::kFormat, files.where.string(),
                "changes " + std::to_string(strangers.size()) +
                    " modules that this model does not have, such as that of " + strangers.front() +
                    "; the LoRA was made for another family of models");
  }
}

}  // namespace

LoraSet match_loras(std::span<const LoraChoice> choices, const UNetPart& unet,
                    std::span<const TensorTable* const> text_encoders) {
  LoraSet set;
  set.text_encoders.resize(text_encoders.size());
  if (choices.empty()) return set;
  std::vector<Target> targets{{&unet.table,
                               flat_names(unet.table, unet_names(unet.config.levels)),
                               {"lora_unet_", "unet_", "diffusion_model_"},
                               "unet"}};
  for (size_t i = 0; i < text_encoders.size(); ++i) {
    // diffusers counts from the second on, and kohya with it.
    const std::string number = i == 0 ? "" : std::to_string(i + 1),
                      name = i == 0 ? "text_encoder" : "text_encoder_" + number;
    targets.push_back(
        {text_encoders[i], flat_names(*text_encoders[i], {}), {"lora_te" + number + "_", name + "_"}, name});
  }
  std::vector<LoraDeltas> deltas(targets.size());
  for (const LoraChoice& choice : choices) {
    match_lora(deltas, choice, targets);
    set.files.push_back(choice.file);
  }
  set.unet = std::move(deltas.front());
  std::move(deltas.begin() + 1, deltas.end(), set.text_encoders.begin());
  return set;
}

}  // namespace patina::diffusion
