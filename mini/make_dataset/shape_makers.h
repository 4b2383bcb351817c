// The makers behind make_shape: each draws the proportions of one kind of object. Sizes are relative, +Y up.
#pragma once

#include "mesh.h"
#include "mini_data/draw.h"

namespace patina::make_dataset {

using mini_data::Draw;

// Turned on a lathe (shapes_vessels.cpp).
Mesh vase(Draw& d);
Mesh bottle(Draw& d);
Mesh bowl(Draw& d);
Mesh kettle(Draw& d);
Mesh mug(Draw& d);
Mesh goblet(Draw& d);
Mesh barrel(Draw& d);
Mesh bell(Draw& d);
Mesh bucket(Draw& d);
Mesh column(Draw& d);

// Built of boxes, prisms and pipes (shapes_built.cpp).
Mesh crate(Draw& d);
Mesh chest(Draw& d);
Mesh gear(Draw& d);
Mesh valve(Draw& d);
Mesh lantern(Draw& d);
Mesh chair(Draw& d);
Mesh table(Draw& d);
Mesh anvil(Draw& d);
Mesh letter(Draw& d);
Mesh house(Draw& d);
Mesh car(Draw& d);
Mesh hydrant(Draw& d);
Mesh wall(Draw& d);

// Grown, carved and worn (shapes_figures.cpp).
Mesh rock(Draw& d);
Mesh statue(Draw& d);
Mesh bust(Draw& d);
Mesh robot(Draw& d);
Mesh helmet(Draw& d);
Mesh ornament(Draw& d);
Mesh knot(Draw& d);
Mesh cloth(Draw& d);
Mesh boot(Draw& d);

}  // namespace patina::make_dataset
