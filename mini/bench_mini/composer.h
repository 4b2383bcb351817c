// Pictures of known materials: plans of mini_data carried out into plain images, so that the rest of
// the benchmark sees no Torch.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "mini_data/plan.h"
#include "patina/image/image.h"

namespace patina::bench {

/// One view of a plan. [H,W,3] sRGB [0,1] and [H,W,1] [0,1], H = W = mini_data::kViewSide.
struct Composed {
  Image before, after;  // the clean render and the aged one
  Image coverage;       // share of the pixel that the object fills
  Image age_mask;       // how much of the surface's colour the plan's layers made up
};

/// How the model that is judged would show what it painted: `after` through its autoencoder, with the fine
/// detail of `before` that `patina enhance` gives back. All [H,W,3] sRGB in [0,1].
using AsEditedView = std::function<Image(const Image& before, const Image& after)>;

/// Objects of one part and materials of one part in memory, about 1.9 MB a view and 0.5 MB a material. Of the
/// objects only those in nearly white light, as the product's studio is: under a red sky all is brick.
class Composer {
 public:
  /// Parts are training or held-out. Throws Error{kNotFound, kFormat} where `shards` is not what make_dataset
  /// packs.
  Composer(const std::filesystem::path& shards, mini_data::Part objects, mini_data::Part materials);
  ~Composer();
  Composer(const Composer&) = delete;
  Composer& operator=(const Composer&) = delete;

  const mini_data::Catalog& catalog() const;
  /// The views of a plan follow each other; all plans have the same number of views.
  std::vector<Composed> compose(std::span<const mini_data::Plan> plans) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace patina::bench
