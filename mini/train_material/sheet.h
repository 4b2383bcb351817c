// Pictures of what the network makes of held-out samples.
#pragma once

#include <filesystem>

#include "patina/prior/material_network.h"
#include "records.h"

namespace patina::train_material {

/// One row a sample: edited view, clean render; then pairs of estimate and truth: base colour, roughness,
/// metallic, normals; last the expected errors of base colour, roughness and slope as red, green and blue,
/// white is 0.2.
void write_sheet(const prior::MaterialNetwork& network, const Records& records, int64_t rows, bool disturb,
                 const std::filesystem::path& file);

}  // namespace patina::train_material
