// LibTorch's 3×3 convolutions beside Winograd's, at the sizes of Stable Diffusion 1.5's U-Net and VAE.
#pragma once

#include <nlohmann/json.hpp>

namespace patina::bench {

/// For each size: seconds of both (the best of `repeat`), and the error of each against f32 relative to the
/// spread of the result. bf16, all threads. Empty where Winograd's does not pay.
nlohmann::json measure_convolutions(int repeat);

}  // namespace patina::bench
