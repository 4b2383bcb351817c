// A network that stays in memory, or one that is read anew for each use and goes when the use is over.
#pragma once

#include <functional>
#include <memory>
#include <type_traits>
#include <utility>

namespace patina::diffusion {

template <class Network>
class Held {
 public:
  using Config = std::decay_t<decltype(std::declval<const Network&>().config())>;

  /// Stays in memory.
  explicit Held(Network network)
      : config_(network.config()),
        num_parameters_(network.num_parameters()),
        resident_(std::make_shared<const Network>(std::move(network))) {}
  /// Read by `read` for each use.
  Held(Config config, int64_t num_parameters, std::function<std::shared_ptr<const Network>()> read)
      : config_(std::move(config)), num_parameters_(num_parameters), read_(std::move(read)) {}

  /// The network, for as long as the pointer lives.
  std::shared_ptr<const Network> use() const { return resident_ ? resident_ : read_(); }

  bool is_resident() const { return resident_ != nullptr; }
  const Config& config() const { return config_; }
  int64_t num_parameters() const { return num_parameters_; }

 private:
  Config config_;
  int64_t num_parameters_ = 0;
  std::shared_ptr<const Network> resident_;
  std::function<std::shared_ptr<const Network>()> read_;
};

}  // namespace patina::diffusion
