// Every option with another value than its default, and which stages of a finished run that value makes run
// again. Written by hand from what the options mean.
#pragma once

#include <string>
#include <vector>

namespace patina::pipeline {

struct OptionCase {
  std::string name;
  std::vector<std::string> texts;  // "FILE:x" stands for file x of the test's folder
  std::string runs_again;          // of "render detail fit report"
};

inline const std::string kAll = "render detail fit report", kFromEdit = "detail fit report",
                         kFromFit = "fit report";

// Of the model's parts the test has copies, so that what is made of them is the same and later stages stay.
inline const std::vector<OptionCase> kOptionCases{
    {"preset", {"fast"}, kAll},
    {"prompt", {"a mossy kettle"}, kFromEdit},
    {"negative-prompt", {"shiny"}, kFromEdit},
    {"prompt-for", {"enamel=moss"}, kFromEdit},
    {"negative-prompt-for", {"enamel=shiny"}, kFromEdit},
    {"exemplar", {"FILE:mask.png"}, kFromEdit},
    {"strength", {"1"}, kFromEdit},
    {"guidance-scale", {"3"}, kFromEdit},
    {"steps", {"4"}, kFromEdit},
    {"scheduler", {"dpm++2m-karras"}, kFromEdit},
    {"tile-scale", {"0.5"}, kFromEdit},
    {"normal-scale", {"0.5"}, kFromEdit},
    {"fine-detail", {"0.5"}, kFromEdit},

    {"mask", {"FILE:mask.png"}, kFromEdit},
    {"mask-vertex-color", {"true"}, kFromEdit},
    {"strength-for", {"enamel=0.5"}, kFromEdit},
    {"protect", {"enamel"}, kFromEdit},
    {"where", {"up:0.5"}, kFromEdit},

    {"output", {"FILE:out.glb"}, ""},
    {"blend", {"0.5"}, "report"},
    {"run", {"FILE:elsewhere"}, ""},
    {"keep", {"true"}, ""},
    {"material", {"enamel"}, kFromFit},
    {"turntable", {"2"}, "report"},

    {"model", {"FILE:model"}, "detail"},
    {"controlnet-tile", {"FILE:model/controlnet_tile"}, "detail"},
    {"controlnet-normal", {"FILE:model/controlnet_normal"}, "detail"},
    {"vae", {"FILE:model/vae"}, "detail"},
    {"text-encoder", {"FILE:model/text_encoder"}, "detail"},
    {"tokenizer", {"FILE:model/tokenizer"}, "detail"},
    {"lora", {"FILE:lora.safetensors:0.9"}, kFromEdit},
    {"embedding", {"FILE:word.safetensors"}, "detail"},  // a word that the prompt does not hold
    {"model-dir", {"FILE:model-dir"}, "detail"},
    {"clip-skip", {"2"}, kFromEdit},
    {"prediction", {"v"}, kFromEdit},
    {"dtype", {"bf16"}, kFromEdit},
    {"device", {"cpu"}, "detail"},       // what auto took anyway
    {"low-memory", {"true"}, "detail"},  // in f32 it rounds alike

    {"views", {"1"}, kAll},
    {"resolution", {"128"}, kAll},
    {"elevation", {"-10", "40"}, kAll},
    {"azimuth", {"30"}, kAll},
    {"fov", {"50"}, kAll},
    {"distance", {"2"}, kAll},
    {"cameras", {"FILE:cameras.json"}, kAll},
    {"environment", {"FILE:sky.exr"}, kAll},
    {"scene", {"FILE:context.glb"}, kAll},
    {"exposure", {"1"}, kAll},
    {"samples", {"2"}, kAll},
    {"max-depth", {"2"}, kAll},
    {"bsdf", {"principled"}, kAll},

    {"noise", {"independent"}, kFromEdit},
    {"bias", {"0"}, kFromEdit},
    {"bias-scaling", {"paper"}, kFromEdit},
    {"bias-controlnet", {"true"}, kFromEdit},

    {"fit-iterations", {"4"}, kFromFit},
    {"texture-size", {"64"}, kFromFit},
    {"fit", {"base_color"}, kFromFit},
    {"light-samples", {"6"}, kFromFit},
    {"boundary", {"1"}, kFromFit},
    {"unseen", {"keep"}, kFromFit},
    {"keep-in-place", {"true"}, "fit"},  // one iteration moves no view yet

    {"seed", {"9"}, kAll},
    {"edit-seed", {"3"}, kFromEdit},
    {"seeds", {"2"}, "detail"},
    {"threads", {"1"}, ""},
};

}  // namespace patina::pipeline
