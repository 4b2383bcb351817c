#include "patina/diffusion/model_parts.h"

#include <algorithm>
#include <sstream>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/diffusion/control_kinds.h"
#include "patina/diffusion/files/search_folders.h"
#include "patina/diffusion/list_models.h"
#include "patina/diffusion/text/find_tokenizer.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// What the model folders hold, looked up when first needed.
class Folders {
 public:
  explicit Folders(const ModelPaths& paths) : folders_(paths.model_dirs) {
    // A checkpoint in <tool>/models/… brings the tool's other models with it.
    if (!fs::exists(paths.model)) return;
    fs::path at = fs::absolute(paths.model).parent_path();
    for (int level = 0; level < 4 && at.has_filename(); ++level, at = at.parent_path()) {
      if (lowered(at.filename().string()) != "models" || !fs::is_directory(at)) continue;
      tool_ = at.parent_path();
      // Besides models/, where AUTOMATIC1111 keeps embeddings and its extension ControlNets.
      for (const fs::path& folder :
           {at, tool_ / "embeddings", tool_ / "extensions" / "sd-webui-controlnet" / "models"}) {
        if (fs::is_directory(folder)) folders_.push_back(folder);
      }
      return;
    }
  }

  const FoundFiles& found() {
    if (!found_) found_ = search_folders(folders_);
    return *found_;
  }
  /// Where a tokenizer may lie: the folders of tools, not of their models alone.
  std::vector<fs::path> for_tokenizers() const {
    std::vector<fs::path> folders = folders_;
    if (!tool_.empty()) folders.push_back(tool_);
    return folders;
  }
  std::string text() const {
    std::string list;
    for (const fs::path& folder : folders_) list += (list.empty() ? "" : ", ") + folder.string();
    return list.empty() ? "no model folder was given" : "the model folders are " + list;
  }

 private:
  std::vector<fs::path> folders_;
  fs::path tool_;  // around the model; empty: none
  std::optional<FoundFiles> found_;
};

/// A path as it is, or the file or folder of that name in the model folders.
fs::path resolve(const fs::path& given, FileKind kind, Folders& folders) {
  if (given.empty() || fs::exists(given)) return given;
  const std::string wanted = lowered(given.string());
  std::vector<fs::path> candidates;
  const FoundFiles& found = folders.found();
  for (const auto* paths : {&found.models, &found.weights}) {
    for (const fs::path& path : *paths) {
      if (lowered(path.filename().string()) == wanted || lowered(path.stem().string()) == wanted)
        candidates.push_back(path);
    }
  }
  // Two files of one name in the folders of two kinds: their tensors tell.
  for (const fs::path& path : candidates) {
    if (candidates.size() == 1 || describe_entry(path).kind == kind) return path;
  }
  throw Error(
      ErrorCode::kNotFound, given.string(),
      std::string("does not exist, and there is no ") + name_of(kind) + " of that name: " + folders.text());
}

/// A ControlNet of the model's family whose name says what it is for.
std::optional<fs::path> controlnet_named(const std::string& word, const UNetConfig& unet, Folders& folders) {
  for (const fs::path& path : folders.found().weights) {
    if (lowered(path.filename().string()).find(word) == std::string::npos) continue;
    const ModelEntry entry = describe_entry(path);
    if (entry.kind == FileKind::kControlNet && entry.refusal.empty() && entry.family == family_of(unet))
      return path;
  }
  return std::nullopt;
}

ControlNetPart find_controlnet(const ControlKind& kind, const ModelPaths& paths, Folders& folders,
                               ModelParts& parts) {
  if (const fs::path& given = paths.*kind.path; !given.empty())
    return open_controlnet(resolve(given, FileKind::kControlNet, folders));
  const fs::path component = paths.model / kind.component;
  if (fs::exists(component)) return open_controlnet(component);
  if (const auto found = controlnet_named(kind.name, parts.unet.config, folders)) {
    parts.notes.push_back(std::string("ControlNet ") + kind.name + ": " + found->string());
    return open_controlnet(*found);
  }
  throw Error(ErrorCode::kNotFound, paths.model.string(),
              std::string("comes without a ControlNet for ") + kind.name +
                  "; name a file or folder of one, or put one for " + name_of(parts.family) +
                  " whose name holds '" + kind.name + "' into a model folder (" + folders.text() + ")");
}

/// Models of other tasks have the same tensors but for the first convolution, which takes more than it gives.
void check_task(const UNetPart& unet) {
  const int64_t channels = unet.config.in_channels;
  if (channels == unet.config.out_channels) return;
  const char* task = channels == 9   ? "an inpainting model"
                     : channels == 8 ? "an InstructPix2Pix model"
                     : channels == 7 ? "an upscaler"
                     : channels == 5 ? "a depth-to-image model"
                                     : nullptr;
  if (task)
    throw Error(ErrorCode::kUnsupported, unet.table.where.string(),
                std::string("is ") + task + " (its U-Net takes " + std::to_string(channels) +
                    " channels); expected a text-to-image model, whose U-Net takes 4");
}

/// model_index.json names the class of the whole model, and may say how it is to be guided.
void read_model_index(ModelParts& parts, const fs::path& folder) {
  const fs::path file = folder / "model_index.json";
  if (!fs::exists(file)) return;
  parts.files.push_back(file);
  const json index = json::parse(read_text_file(file, 1 << 24), nullptr, /*allow_exceptions=*/false);
  if (!index.is_object()) throw Error(ErrorCode::kFormat, file.string(), "is not a JSON object");
  const auto text = [&](const char* key) {
    return index.contains(key) && index[key].is_string() ? index[key].get<std::string>() : "";
  };
  parts.guidance.negative_prompt = text("_negative_prompt");
  if (const json scale = index.value("_guidance_scale", json()); scale.is_number()) {
    parts.guidance.scale = scale.get<float>();
    if (!(parts.guidance.scale >= 1 && parts.guidance.scale <= 50))
      throw Error(ErrorCode::kFormat, file.string(),
                  "_guidance_scale is " + scale.dump() + ", expected 1 to 50");
  }
  const std::string name = text("_class_name");
  if (name.empty() || std::any_of(kPipelineClasses.begin(), kPipelineClasses.end(),
                                  [&](std::string_view known) { return name.starts_with(known); }))
    return;
  throw Error(ErrorCode::kUnsupported, file.string(),
              "is the index of a " + printable(name, 80) + "; patina runs " + kFamilyNames +
                  " (StableDiffusionPipeline)");
}

/// "parameterization: v" in the settings that the original implementation keeps beside a checkpoint.
bool settings_say_v(const fs::path& settings) {
  std::istringstream lines(read_text_file(settings, 1 << 20));
  for (std::string line; std::getline(lines, line);) {
    const size_t key = line.find("parameterization:");
    if (key == std::string::npos || line.find('#') < key) continue;
    const size_t value = line.find_first_not_of(" \t\"'", key + std::string_view("parameterization:").size());
    return value != std::string::npos && line[value] == 'v';
  }
  return false;
}

/// What a single file's U-Net predicts, in the order of how sure the sign is.
void find_prediction(ModelParts& parts, const ModelPaths& paths, const fs::path& file,
                     const WeightFiles& files) {
  Prediction& prediction = parts.scheduler.prediction;
  if (paths.prediction != PredictionChoice::kAuto) return;  // the caller sets it
  for (const char* extension : {".yaml", ".yml"}) {
    fs::path settings = file;
    settings.replace_extension(extension);
    if (!fs::exists(settings)) continue;
    prediction = settings_say_v(settings) ? Prediction::kV : Prediction::kEpsilon;
    parts.files.push_back(settings);
    return;
  }
  if (files.tensors.contains("v_pred")) {
    prediction = Prediction::kV;
    return;
  }
  // Other families predict noise, but for fine-tunes that bring one of the signs above.
  parts.ask_prediction = traits_of(parts.family).prediction_varies;
}

void open_diffusers_folder(ModelParts& parts, const ModelPaths& paths, const fs::path& model) {
  read_model_index(parts, model);
  const auto component = [&](const char* name) {
    const fs::path folder = model / name;
    if (!fs::is_directory(folder))
      throw Error(ErrorCode::kNotFound, folder.string(),
                  "does not exist; expected the folder of the model's " + std::string(name));
    return folder;
  };
  parts.unet = open_unet(component("unet"));
  if (paths.text_encoder.empty()) parts.texts.push_back({open_text_encoder(component("text_encoder"))});
  if (paths.vae.empty()) parts.vae = open_vae(component("vae"));
  const fs::path scheduler = component("scheduler") / "scheduler_config.json";
  parts.scheduler = parse_scheduler_config(read_text_file(scheduler, 1 << 24), scheduler.string());
  parts.files.push_back(scheduler);
  for (const std::string& name : component_folders()) {
    if (fs::exists(model / name / "config.json")) parts.files.push_back(model / name / "config.json");
  }
}

void open_single_file(ModelParts& parts, const ModelPaths& paths, const fs::path& file) {
  const WeightFiles files = open_weight_files(file);
  require_kind(files, FileKind::kCheckpoint);
  parts.unet = open_unet(file);
  parts.family = family_of(parts.unet.config);
  const auto require = [&](Network network) {
    if (find_network(files, network)) return;
    throw Error(ErrorCode::kNotFound, file.string(),
                std::string("holds no ") + name_of(network) +
                    "; name one: a component's folder, a file of its own or another checkpoint");
  };
  if (paths.text_encoder.empty()) {
    require(Network::kTextEncoder);
    parts.texts.push_back({open_text_encoder(file)});
  }
  if (paths.vae.empty()) {
    require(Network::kVae);
    parts.vae = open_vae(file);
  }
  find_prediction(parts, paths, file, files);
}

void add_files(std::vector<fs::path>& list, const TensorTable& table) {
  for (const auto& [name, tensor] : table.tensors) {
    if (std::find(list.begin(), list.end(), tensor.file->path()) == list.end())
      list.push_back(tensor.file->path());
  }
}

/// Words of the files given, of the LoRAs, then of those in the model folders that fit this model.
void find_words(TextPart& text, ModelParts& parts, const ModelPaths& paths, Folders& folders) {
  const int64_t width = text.encoder.config.hidden_size;
  const auto add = [&](const fs::path& path) {
    for (LearnedWord& word : read_embedding(path, width)) text.words.push_back(std::move(word));
    parts.files.push_back(path);
  };
  for (const fs::path& given : paths.embeddings) add(resolve(given, FileKind::kEmbedding, folders));
  for (const fs::path& lora : parts.loras.files) {
    for (LearnedWord& word : read_bundled_words(lora, width)) text.words.push_back(std::move(word));
  }
  for (const fs::path& path : folders.found().weights) {
    // Embeddings are small; a look at the size spares reading the headers of everything else.
    constexpr uintmax_t kMaxEmbeddingBytes = 4'000'000;
    if (fs::is_directory(path) || fs::file_size(path) > kMaxEmbeddingBytes) continue;
    try {
      add(path);
    } catch (const Error&) {
      // Another kind of file, or made for another family: nobody asked for it.
    }
  }
}

/// The tokenizer of a text encoder, and how it pads.
void find_tokenizer_of(TextPart& text, const ModelPaths& paths, const Folders& folders) {
  text.tokenizer = find_tokenizer(
      {paths.tokenizer, paths.model, folders.for_tokenizers(), text.encoder.config.vocab_size});
  // A diffusers folder's own tokenizer says how it pads; one from elsewhere is CLIP's and does not know.
  const bool from_elsewhere =
      !fs::is_directory(paths.model) || text.encoder.table.naming == Naming::kOpenClip;
  if (!from_elsewhere) return;
  for (const FamilyTraits& traits : kFamilies)
    if (traits.activation == text.encoder.config.activation) text.pad_id = traits.pad_id;
}

/// LoRAs change the U-Net and the text encoders.
LoraSet find_loras(const ModelParts& parts, const ModelPaths& paths, Folders& folders) {
  std::vector<LoraChoice> choices = paths.loras;
  for (LoraChoice& lora : choices) lora.file = resolve(lora.file, FileKind::kLora, folders);
  std::vector<const TensorTable*> texts;
  for (const TextPart& text : parts.texts) texts.push_back(&text.encoder.table);
  return match_loras(choices, parts.unet, texts);
}

/// Every file behind the parts, beside those that are noted already.
void note_files(ModelParts& parts) {
  add_files(parts.files, parts.unet.table);
  for (const TextPart& text : parts.texts) add_files(parts.files, text.encoder.table);
  add_files(parts.files, parts.vae.table);
  for (const ControlNetPart& controlnet : parts.controlnets) add_files(parts.files, controlnet.table);
  parts.files.insert(parts.files.end(), parts.loras.files.begin(), parts.loras.files.end());
  for (const TextPart& text : parts.texts) {
    for (const char* name :
         {"merges.txt", "vocab.json", "tokenizer_config.json", "special_tokens_map.json"}) {
      if (fs::exists(text.tokenizer / name)) parts.files.push_back(text.tokenizer / name);
    }
  }
}

}  // namespace

std::vector<std::string> component_folders() {
  std::vector<std::string> names{"unet", "text_encoder", "vae"};
  for (const ControlKind& kind : kControlKinds) names.emplace_back(kind.component);
  return names;
}

ModelParts find_model_parts(const ModelPaths& paths) {
  nn::refuse_pickle_name(paths.model);
  Folders folders(paths);
  ModelParts parts;
  ModelPaths resolved = paths;
  resolved.model = resolve(paths.model, FileKind::kCheckpoint, folders);

  if (fs::is_directory(resolved.model))
    open_diffusers_folder(parts, resolved, resolved.model);
  else
    open_single_file(parts, resolved, resolved.model);
  parts.family = family_of(parts.unet.config);
  check_task(parts.unet);
  if (!paths.text_encoder.empty())
    parts.texts.push_back({open_text_encoder(resolve(paths.text_encoder, FileKind::kTextEncoder, folders))});
  if (!paths.vae.empty()) parts.vae = open_vae(resolve(paths.vae, FileKind::kVae, folders));
  if (paths.prediction != PredictionChoice::kAuto)
    parts.scheduler.prediction =
        paths.prediction == PredictionChoice::kV ? Prediction::kV : Prediction::kEpsilon;

  for (const ControlKind& kind : kControlKinds)
    parts.controlnets.push_back(find_controlnet(kind, resolved, folders, parts));
  for (TextPart& text : parts.texts) find_tokenizer_of(text, resolved, folders);
  parts.loras = find_loras(parts, resolved, folders);
  for (TextPart& text : parts.texts) find_words(text, parts, paths, folders);
  note_files(parts);
  return parts;
}

}  // namespace patina::diffusion
