// An autoencoder that passes colours before it has learnt anything.
#pragma once

#include "parameters.h"

namespace patina::train_mini {

/// Sets the first three channels of every layer of an autoencoder with random weights so that they carry
/// red, green and blue: averaged down to three of the latents, and spread out again to the picture. What is
/// trained from there only adds to it. Begun at random, an autoencoder of these pictures, most of which are
/// grey or brown, takes long to find green, or never does.
void lay_colour_path(Parameters& parameters);

}  // namespace patina::train_mini
