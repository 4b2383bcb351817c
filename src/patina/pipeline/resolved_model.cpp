#include "patina/pipeline/resolved_model.h"

#include <sys/resource.h>

#include <cstdint>
#include <optional>

#include <fmt/format.h>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/check_model.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;

std::string hash_of_files(const std::vector<fs::path>& files) {
  std::string text;
  for (const fs::path& file : files) {
    std::error_code ignored;
    text += fmt::format("{} {} {}\n", file.string(), fs::file_size(file, ignored),
                        fs::last_write_time(file, ignored).time_since_epoch().count());
  }
  return hash_text(text);
}

// OpenBLAS, under LibTorch, waits for ever for a buffer that it cannot have, so a limit that is too low must
// be told before. With 1.2 to 1.5 GB runs of the smallest model failed or hung, with 1.6 GB they ended.
void require_address_space() {
  constexpr uint64_t kLeast = 2000ull << 20;
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur >= kLeast)
    return;
  throw Error(
      ErrorCode::kDevice, "memory",
      fmt::format("this process may use {} MB of addresses (ulimit -v); the networks need at least {}, "
                  "larger views more. Raise the limit",
                  limit.rlim_cur >> 20, kLeast >> 20));
}

diffusion::ModelParts find_parts(const EditSettings& settings) {
  if (settings.model.model.empty())
    throw Error(
        ErrorCode::kUsage, "model",
        "give a diffusion model: a diffusers folder or a .safetensors checkpoint of Stable Diffusion 1.x or "
        "2.x; `patina models DIR` lists those in a folder");
  diffusion::check_device(settings.device, settings.dtype);
  require_address_space();
  diffusion::ModelParts parts = diffusion::find_model_parts(settings.model);
  diffusion::check_model(parts, settings.options.scheduler);
  return parts;
}

}  // namespace

struct ResolvedModel::State {
  diffusion::ModelOptions options;
  std::optional<diffusion::ModelParts> parts;  // until they are loaded: they keep the files mapped
  std::vector<fs::path> files;
  std::string hash;
  std::optional<diffusion::Model> model;
  std::mutex mutex;  // whoever holds it works with the networks
};

ResolvedModel::ResolvedModel(const EditSettings& settings)
    : state_(new State{
          .options = {.dtype = settings.dtype, .low_memory = settings.low_memory, .device = settings.device},
          .parts = find_parts(settings),
          .files = {},
          .hash = {},
          .model = std::nullopt,
          .mutex = {}}) {
  state_->files = state_->parts->files;
  state_->hash = hash_of_files(state_->files);
}

ResolvedModel::~ResolvedModel() = default;
ResolvedModel::ResolvedModel(ResolvedModel&&) noexcept = default;
ResolvedModel& ResolvedModel::operator=(ResolvedModel&&) noexcept = default;

const std::string& ResolvedModel::hash() const {
  return state_->hash;
}

const std::vector<fs::path>& ResolvedModel::files() const {
  return state_->files;
}

const diffusion::Model& ResolvedModel::loaded() {
  if (!state_->model) {
    PATINA_CHECK(state_->parts.has_value());
    state_->model.emplace(*state_->parts, state_->options);
    state_->parts.reset();
  }
  return *state_->model;
}

bool ResolvedModel::is_loaded() const {
  return state_->model.has_value();
}

void ResolvedModel::unload() {
  state_->model.reset();
  state_->parts.reset();
}

std::unique_lock<std::mutex> ResolvedModel::alone() {
  return std::unique_lock(state_->mutex);
}

std::shared_ptr<ResolvedModel> ModelShelf::take(const EditSettings& settings) {
  const std::lock_guard lock(mutex_);
  Known asked{settings.model, settings.dtype, settings.device, settings.low_memory,
              settings.options.scheduler};
  std::shared_ptr<ResolvedModel> model = latest_.lock();
  if (model && known_ == asked) return model;
  model.reset();
  kept_.reset();  // before another one is opened
  model = std::make_shared<ResolvedModel>(settings);
  known_ = std::move(asked);
  latest_ = model;
  if (keeps_) kept_ = model;
  return model;
}

void ModelShelf::stop_keeping() {
  const std::lock_guard lock(mutex_);
  keeps_ = false;
  kept_.reset();
}

}  // namespace patina::pipeline
