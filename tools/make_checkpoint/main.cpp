// make_checkpoint: a Stable Diffusion checkpoint of random weights, as a single file, a diffusers folder, a
// ControlNet, a VAE or a LoRA, for testing and measuring at the real size without anybody's weights.
#include <map>

#include "console/numbers.h"
#include "console/program.h"
#include "make_checkpoint/checkpoint.h"
#include "patina/base/error.h"

namespace {

using namespace patina;
using namespace patina::make_checkpoint;

const std::map<std::string, Family> kFamilies{{"sd1", Family::kSd1}, {"sd2", Family::kSd2}};
const std::map<std::string, Size> kSizes{{"full", Size::kFull}, {"small", Size::kSmall}};
const std::map<std::string, nn::ElementType> kTypes{
    {"f32", nn::ElementType::kF32}, {"f16", nn::ElementType::kF16}, {"bf16", nn::ElementType::kBF16}};

void write(const std::string& layout, const std::string& out, const Model& model,
           const FolderOptions& folder) {
  if (layout == "single") return write_single_file(out, model);
  if (layout == "diffusers") return write_diffusers_folder(out, model, folder);
  if (layout == "vae") return write_vae(out, model, Layout::kLdm);
  if (layout == "lora") return write_lora(out, model);
  if (layout == "controlnet-tile" || layout == "controlnet-normal")
    return write_controlnet(out, model, Layout::kLdmPrefixed, layout == "controlnet-normal");
  throw Error(ErrorCode::kUsage, "--layout",
              "is '" + printable(layout) +
                  "', expected single, diffusers, vae, lora, controlnet-tile or controlnet-normal");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Writes a Stable Diffusion checkpoint of random weights.", "make_checkpoint");
  std::string out, layout = "single";
  Family family = Family::kSd1;
  Size size = Size::kFull;
  Model model;
  model.type = nn::ElementType::kF16;
  FolderOptions folder;
  int64_t vocabulary = 0;
  program.add_option("OUT", out, "File or folder to write.")->required();
  program.add_option("--layout", layout,
                     "single | diffusers | vae | lora | controlnet-tile | controlnet-normal [single]");
  program.add_option("--family", family, "sd1 | sd2 [sd1]")->transform(CLI::CheckedTransformer(kFamilies));
  program.add_option("--size", size, "full | small [full]")->transform(CLI::CheckedTransformer(kSizes));
  program.add_option("--dtype", model.type, "f32 | f16 | bf16 [f16]")
      ->transform(CLI::CheckedTransformer(kTypes));
  program.add_option("--seed", model.seed, "Of the values. [1]")->check(tools::whole_number(0));
  program.add_option("--vocabulary", vocabulary, "Tokens of the text encoder. [49408]")
      ->check(tools::whole_number(1));
  program.add_option("--shards", folder.num_shards, "Files of the U-Net (diffusers). [1]")
      ->check(tools::whole_number(1));
  program.add_option("--variant", folder.variant, "In the names of weight files (diffusers), such as fp16.");
  program.add_option("--tokenizer", folder.tokenizer, "Folder to copy into the model (diffusers).");
  program.add_flag("--empty", model.empty, "Zeros that take no place on disk.");
  return tools::run_program(program, argc, argv, [&] {
    model.configs = configs_of(family, size, vocabulary);
    write(layout, out, model, folder);
  });
}
