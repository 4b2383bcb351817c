// Teaches the text encoder what words look like, before the denoiser meets them.
#pragma once

#include <filesystem>

#include "run.h"

namespace patina::train_mini {

/// Trains the text encoder to foretell, from the caption alone and through one linear map of the mean of its
/// output, the class that was asked for, and the mean and the spread of the aged picture's colours. A
/// denoiser that begins with such words listens to them from its first steps; with a text encoder that begins
/// at random it learnt to do without. WORK gets text_encoder.checkpoint, which train_denoiser goes on from.
/// Throws Error kUsage where there is one already: training anew would undo what the denoiser made of it.
void train_words(const std::filesystem::path& work, const std::filesystem::path& model,
                 const RunOptions& options);

}  // namespace patina::train_mini
