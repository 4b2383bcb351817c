#include "words_training.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <vector>

#include <ATen/ATen.h>

#include "captions.h"
#include "parameters.h"
#include "patina/base/error.h"
#include "patina/diffusion/networks/text_encoder.h"
#include "patina/diffusion/text/tokenizer.h"
#include "samples.h"

namespace patina::train_mini {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kBatch = 96;
constexpr int64_t kLooks = 12;  // mean and spread of three colours, and what both differ by from the tile's

/// What the caption of sample `index` should foretell, [12], in [-1,1] about.
at::Tensor look_of(const SampleFolder& samples, int64_t index) {
  const at::Tensor pictures = samples.pictures(index).slice(2, 0, at::nullopt, 2).slice(3, 0, at::nullopt, 2);
  const auto looks = [&](int64_t which) {
    const at::Tensor colours = pictures[which].to(at::kFloat).reshape({3, -1}) / 127.5 - 1;
    // The background is the tile's first pixel.
    const at::Tensor tile = pictures[kTile].reshape({3, -1});
    const at::Tensor inside =
        tile.to(at::kShort).sub(tile.slice(1, 0, 1).to(at::kShort)).abs().amax(0).gt(3).to(at::kFloat);
    const at::Tensor count = inside.sum() + 1, mean = (colours * inside).sum(1) / count;
    const at::Tensor variance = ((colours - mean.unsqueeze(1)).square() * inside).sum(1) / count;
    return at::cat({mean, variance.sqrt()});
  };
  const at::Tensor aged = looks(kTarget);
  return at::cat({aged, aged - looks(kTile)});
}

struct Captioned {
  std::vector<std::string> captions;
  at::Tensor looks;    // [n,12]
  at::Tensor classes;  // [n] int64
};

/// One view of each object: the others have the same words and nearly the same look.
Captioned captioned(const SampleFolder& samples, std::map<std::string, int64_t>& class_ids) {
  Captioned out;
  std::vector<at::Tensor> looks;
  std::vector<int64_t> classes;
  for (int64_t i = 0; i < samples.size(); ++i) {
    const Sample& sample = samples.samples()[static_cast<size_t>(i)];
    if (sample.view != 0 || sample.caption.empty()) continue;
    out.captions.push_back(sample.caption);
    looks.push_back(look_of(samples, i));
    classes.push_back(
        class_ids.emplace(sample.asked_class, static_cast<int64_t>(class_ids.size())).first->second);
  }
  out.looks = at::stack(looks);
  out.classes = at::tensor(classes, at::kLong);
  return out;
}

}  // namespace

void train_words(const fs::path& work, const fs::path& model, const RunOptions& options) {
  const fs::path checkpoint = work / "text_encoder.checkpoint";
  if (fs::exists(checkpoint))
    throw Error(ErrorCode::kUsage, checkpoint.string(),
                "a text encoder was trained already; remove it and the denoiser's checkpoints to begin anew");
  const diffusion::Tokenizer tokenizer(model / "tokenizer");
  const auto config = diffusion::read_text_encoder_config(model / "text_encoder");
  std::map<std::string, int64_t> class_ids;
  const Captioned training = captioned(SampleFolder(work / "training"), class_ids);
  const auto num_classes = static_cast<int64_t>(class_ids.size());
  const Captioned held_out = captioned(SampleFolder(work / "held_out"), class_ids);
  const at::Tensor centre = training.looks.mean(0), spread = training.looks.std(0, /*unbiased=*/false) + 1e-3;

  Parameters text("text_encoder", options.seed, c10::kCPU), readout("readout", options.seed + 1, c10::kCPU);
  const auto foretold = [&](const std::vector<int64_t>& ids, int64_t count) {
    nn::WeightReader weights(text, at::kFloat);
    const diffusion::TextEncoder encoder(config, weights);
    const at::Tensor hidden = encoder(at::tensor(ids, at::kLong).view({count, -1})).tokens.mean(1);
    const int64_t outputs = kLooks + num_classes;
    return at::linear(hidden, readout.find("map.weight", {outputs, config.hidden_size}, at::kFloat),
                      readout.find("map.bias", {outputs}, at::kFloat));
  };
  const auto encode = [&](const std::string& caption, std::vector<int64_t>& ids) {
    const auto tokens = tokenizer.encode_padded(caption, tokenizer.max_length());
    ids.insert(ids.end(), tokens.begin(), tokens.end());
  };

  Run run(options, work / "words.log", 0);
  for (; !run.finished(); run.next()) {
    std::mt19937_64 random(options.seed + static_cast<uint64_t>(run.step()) * 0x9E3779B97F4A7C15u);
    std::vector<int64_t> ids, chosen;
    for (int64_t i = 0; i < kBatch; ++i) {
      chosen.push_back(static_cast<int64_t>(random() % training.captions.size()));
      encode(with_noise_words(training.captions[static_cast<size_t>(chosen.back())], random), ids);
    }
    const at::Tensor rows = at::tensor(chosen, at::kLong), foretelling = foretold(ids, kBatch);
    const at::Tensor looks = (training.looks.index_select(0, rows) - centre) / spread;
    const at::Tensor error = (foretelling.slice(1, 0, kLooks) - looks).square().mean();
    const at::Tensor class_error =
        at::cross_entropy_loss(foretelling.slice(1, kLooks), training.classes.index_select(0, rows));
    (error + class_error).backward();
    Parameters::Optimizer optimizer;
    optimizer.rate = run.rate();
    text.step(optimizer, run.step());
    readout.step(optimizer, run.step());
    run.log({{"looks", error.item<double>()}, {"classes", class_error.item<double>()}});
  }

  std::vector<int64_t> ids;
  for (const std::string& caption : held_out.captions) encode(caption, ids);
  const at::Tensor foretelling = foretold(ids, static_cast<int64_t>(held_out.captions.size())).detach();
  const at::Tensor looks = (held_out.looks - centre) / spread;
  const at::Tensor error = (foretelling.slice(1, 0, kLooks) - looks).square().mean();
  const at::Tensor right = foretelling.slice(1, kLooks).argmax(1).eq(held_out.classes);
  std::printf("held out: %.3f of the looks' variance is left, %.1f %% of the classes are right\n",
              error.item<double>() / (looks - looks.mean(0)).square().mean().item<double>(),
              100 * right.to(at::kFloat).mean().item<double>());
  text.write(checkpoint);
  text.write_result(model / "text_encoder" / "model.safetensors");
}

}  // namespace patina::train_mini
