# Headers of others cost more than most of our sources, so they are compiled once, into three precompiled headers:
#   torch   LibTorch's, for every source that sees them
#   std     the standard library's, fmt's and glm's, for the other sources
#   test    the same and GoogleTest's, for the other sources of tests
# -DPATINA_PCH=OFF builds without, which finds sources that do not include what they use.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set(PATINA_PCH_DEFAULT ON)
else()
  set(PATINA_PCH_DEFAULT OFF)
endif()
option(PATINA_PCH "Precompile the headers of others (GCC only)" ${PATINA_PCH_DEFAULT})

# patina_precompile(<name> HEADERS <headers> [PACKAGES <targets>]): makes a precompiled header, as position-independent
# as what uses it. LibTorch's targets define the macro, and GCC wants the same ones where the header is used.
function(patina_precompile name)
  cmake_parse_arguments(ARG "" "" "HEADERS;PACKAGES" ${ARGN})
  add_library(patina_${name}_pch OBJECT "${CMAKE_BINARY_DIR}/torch_pch.cpp")
  target_link_libraries(patina_${name}_pch PRIVATE patina_options ${ARG_PACKAGES})
  target_compile_options(patina_${name}_pch PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-fPIC>)
  if(NOT name STREQUAL "torch")
    target_compile_options(patina_${name}_pch PRIVATE -D_GLIBCXX_USE_CXX11_ABI=1)
  endif()
  target_precompile_headers(patina_${name}_pch PRIVATE ${ARG_HEADERS})
endfunction()

if(PATINA_PCH)
  file(WRITE "${CMAKE_BINARY_DIR}/torch_pch.cpp.in" "// Only there to own the precompiled header.\n")
  file(COPY_FILE "${CMAKE_BINARY_DIR}/torch_pch.cpp.in" "${CMAKE_BINARY_DIR}/torch_pch.cpp" ONLY_IF_DIFFERENT)
  patina_precompile(torch HEADERS <ATen/ATen.h> <c10/core/InferenceMode.h> PACKAGES patina_torch)
  set(std <algorithm> <array> <cmath> <cstdint> <filesystem> <fstream> <functional> <limits> <map> <memory> <numeric>
    <optional> <set> <span> <sstream> <string> <string_view> <vector> <fmt/format.h> <glm/glm.hpp>
    <glm/gtc/matrix_transform.hpp> <glm/gtc/quaternion.hpp>)
  patina_precompile(std HEADERS ${std} PACKAGES fmt::fmt)
  if(PATINA_BUILD_TESTS)
    patina_precompile(test HEADERS ${std} <gtest/gtest.h> PACKAGES fmt::fmt GTest::gtest)
  endif()
endif()

# patina_sees_torch(<source> <result>): whether a source includes headers of LibTorch, itself or through others of ours.
function(patina_sees_torch source result)
  get_property(known GLOBAL PROPERTY "patina_sees_torch ${source}")
  if(NOT DEFINED known OR known STREQUAL "")
    set(known NO)
    set_property(GLOBAL PROPERTY "patina_sees_torch ${source}" NO)
    cmake_path(GET source PARENT_PATH folder)
    set(includes)
    if(EXISTS "${source}") # a source that the build makes does not
      file(STRINGS "${source}" includes REGEX "^#include [<\"]")
    endif()
    foreach(include ${includes})
      if(include MATCHES "<(ATen|torch)/" AND NOT include MATCHES "<torch/version.h>")
        set(known YES)
      elseif(include MATCHES "\"([^\"]+)\"")
        set(name "${CMAKE_MATCH_1}")
        foreach(root "${folder}" "${CMAKE_SOURCE_DIR}/src" "${CMAKE_SOURCE_DIR}/tools" "${CMAKE_SOURCE_DIR}/mini"
            "${CMAKE_SOURCE_DIR}/tests")
          if(EXISTS "${root}/${name}")
            cmake_path(ABSOLUTE_PATH name BASE_DIRECTORY "${root}" NORMALIZE OUTPUT_VARIABLE path)
            patina_sees_torch("${path}" known)
            break()
          endif()
        endforeach()
      endif()
      if(known)
        break()
      endif()
    endforeach()
    set_property(GLOBAL PROPERTY "patina_sees_torch ${source}" ${known})
  endif()
  set(${result} ${known} PARENT_SCOPE)
endfunction()

# patina_use_std_pch(<source> <name>): the source begins with header std or test. CMake knows one header a target. GCC 12
# forgets that what comes from it is a system header, and warns of overflows in std::string that are not there.
function(patina_use_std_pch source name)
  set(header "${CMAKE_BINARY_DIR}/CMakeFiles/patina_${name}_pch.dir/cmake_pch.hxx")
  set_property(SOURCE "${source}" APPEND PROPERTY COMPILE_OPTIONS
    -D_GLIBCXX_USE_CXX11_ABI=1 -Wno-array-bounds -Wno-stringop-overread -Winvalid-pch -include "${header}")
  set_property(SOURCE "${source}" APPEND PROPERTY OBJECT_DEPENDS "${header}.gch")
endfunction()

# patina_use_pch(<target> <name>): called at the end of the target's folder, when all its sources are known; name is the
# header of sources that do not see LibTorch. A source with compiler options of its own cannot use what was compiled
# without them.
function(patina_use_pch target name)
  get_target_property(sources ${target} SOURCES)
  set(sees_torch NO)
  foreach(source ${sources})
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE OUTPUT_VARIABLE path)
    get_source_file_property(options "${source}" COMPILE_OPTIONS)
    patina_sees_torch("${path}" sees)
    if(sees AND NOT options)
      set(sees_torch YES)
      continue()
    endif()
    set_source_files_properties("${source}" PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
    if(NOT options AND source MATCHES "\\.cpp$")
      patina_use_std_pch("${source}" ${name})
    endif()
  endforeach()
  add_dependencies(${target} patina_${name}_pch)
  if(sees_torch)
    target_precompile_headers(${target} REUSE_FROM patina_torch_pch)
  endif()
  # The header was compiled as position-independent as a library is, and must be used so; ccache wants the second. A source
  # that cannot use the header for other reasons is compiled without: slower, and with a warning.
  target_compile_options(${target} PRIVATE
    "$<$<COMPILE_LANGUAGE:CXX>:-fPIC;-fpch-preprocess;-Wno-error=invalid-pch>")
endfunction()
