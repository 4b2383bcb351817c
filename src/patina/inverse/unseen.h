// Unseen texels: they get the change that the views made to the surface near them,
// so that a rusty kettle has no clean bottom. Only smooth change can be carried over; the original's own
// detail stays under it.
#pragma once

#include "patina/inverse/evidence.h"

namespace patina::inverse {

/// `change` [h,w,C] with the texels that lie on the surface but have hardly any evidence [h,w,1] filled: the
/// mean change of seen texels around, weighted by evidence, over grid cells in space that are as small as the
/// number of seen texels in them allows. Texels of no surface stay as they are. Nothing seen: returns
/// `change`.
Image spread_to_unseen(const Image& change, const Image& evidence, const SurfaceTexels& surface);

}  // namespace patina::inverse
