// The files of web/ and third_party/ that pages are made of, as the program carries them
// (cmake/embed_text.cmake).
#pragma once

#include <string_view>

namespace patina::report {

extern const std::string_view kPageStyle;      // web/page.css: of every page
extern const std::string_view kWipeScript;     // web/wipe.js: comparison of views
extern const std::string_view kViewerMarkup;   // web/viewer.html, kViewerScript (a module) and
extern const std::string_view kViewerScript;   // web/viewer.js: the asset that turns under the mouse
extern const std::string_view kThreeLibrary;   // third_party/three: three.module.js,
extern const std::string_view kThreeControls;  // OrbitControls.js, unchanged,
extern const std::string_view kThreeLicence;   // and their licence

}  // namespace patina::report
