// EXT_meshopt_compression and KHR_meshopt_compression: buffer views whose bytes the meshoptimizer library
// decompresses.
#pragma once

#include "patina/asset/source_document.h"

namespace patina::asset {

/// Decompresses every view that carries one of the extensions; `views` then points to the result. Throws
/// Error{kFormat, kUnsupported, kLimit} that names the view.
void decompress_meshopt_views(SourceDocument& document);

}  // namespace patina::asset
