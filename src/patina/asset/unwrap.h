// What a user is told whose meshes have no texture coordinates, or none with an area.
#pragma once

namespace patina::asset {

/// The end of such a message. docs/formats.md has the same steps.
inline constexpr const char* kHowToUnwrap =
    "patina does not unwrap meshes, so do it in Blender: import the file, select its meshes, Tab, A, U, "
    "Smart UV Project, OK, Tab, and export it again";

}  // namespace patina::asset
