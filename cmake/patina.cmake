# What every target of patina shares: language level, warnings, optimisation, third-party packages, and the
# functions that declare a library folder, its tests and its benchmarks.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}")
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

find_program(PATINA_CCACHE ccache)
if(PATINA_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${PATINA_CCACHE}")
endif()

# LibTorch's symbols keep the usual linker busy for 2.6 s a program, gold (of the same Debian package) for 0.3 s.
find_program(PATINA_GOLD ld.gold)
if(PATINA_GOLD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_link_options("$<$<LINK_LANGUAGE:CXX>:-fuse-ld=gold>")
endif()

option(PATINA_CUDA "Build the CUDA parts, against a LibTorch 2.x with CUDA" OFF)
if(PATINA_CUDA)
  include(patina_cuda)
endif()

find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(fmt REQUIRED)
find_package(embree 3 REQUIRED)
find_package(Torch REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(OIIO REQUIRED IMPORTED_TARGET OpenImageIO) # its CMake package wants its command-line tools too
pkg_check_modules(WEBP REQUIRED IMPORTED_TARGET libwebp libwebpmux)
pkg_check_modules(UTF8PROC REQUIRED IMPORTED_TARGET libutf8proc)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(DRACO REQUIRED IMPORTED_TARGET draco)
find_package(meshoptimizer REQUIRED)
if(PATINA_BUILD_TESTS)
  find_package(GTest REQUIRED)
  include(GoogleTest)
endif()
if(PATINA_BUILD_BENCH)
  find_package(benchmark REQUIRED)
endif()

add_library(patina_options INTERFACE)
target_compile_features(patina_options INTERFACE cxx_std_20)
target_include_directories(patina_options INTERFACE
  "$<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}/src>" "$<INSTALL_INTERFACE:include>")
if(PATINA_CUDA)
  target_include_directories(patina_options SYSTEM BEFORE INTERFACE "$<BUILD_INTERFACE:${CMAKE_BINARY_DIR}/include_first>")
endif()
# GCC 12 sees overflows and overlaps in std::vector and std::string that are not there (its bugs 105329, 105651).
set(options -Wno-stringop-overflow -Wno-restrict
  -march=${PATINA_ARCH} -Wall -Wextra -Wpedantic -Wshadow $<$<BOOL:${PATINA_WERROR}>:-Werror>)
target_compile_options(patina_options INTERFACE "$<BUILD_INTERFACE:$<$<COMPILE_LANGUAGE:CXX>:${options}>>"
  "$<BUILD_INTERFACE:$<$<COMPILE_LANGUAGE:CUDA>:-Xcompiler=-Wall,-Wextra;$<$<BOOL:${PATINA_WERROR}>:-Werror=all-warnings>>>")
target_compile_definitions(patina_options INTERFACE GLM_FORCE_SILENT_WARNINGS GLM_ENABLE_EXPERIMENTAL
  "$<BUILD_INTERFACE:PATINA_VERSION=\"${PROJECT_VERSION}\">")

# Third-party headers are system headers: their warnings are not ours.
add_library(patina_torch INTERFACE)
target_link_libraries(patina_torch INTERFACE ${TORCH_LIBRARIES})
target_include_directories(patina_torch SYSTEM INTERFACE ${TORCH_INCLUDE_DIRS})

include(precompiled)

# What can be done only when a folder's CMakeLists.txt has added all sources of a target: header std or test for them.
function(patina_finish_later target header)
  if(PATINA_PCH)
    cmake_language(EVAL CODE "cmake_language(DEFER CALL patina_use_pch [[${target}]] [[${header}]])")
  endif()
endfunction()

# patina_library(<folder> SOURCES <files> [DEPS <folders>] [PACKAGES <third-party targets>])
# One static library a folder of src/patina; DEPS repeats the layering rule of docs/architecture.md.
function(patina_library folder)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;PACKAGES" ${ARGN})
  add_library(patina_${folder} STATIC ${ARG_SOURCES})
  # So that a plug-in, which is a shared library, can be linked from it; functions are inlined all the same.
  set_target_properties(patina_${folder} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_compile_options(patina_${folder} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-fno-semantic-interposition>)
  list(TRANSFORM ARG_DEPS PREPEND patina_)
  target_link_libraries(patina_${folder} PUBLIC patina_options ${ARG_DEPS} ${ARG_PACKAGES} Threads::Threads)
  patina_finish_later(patina_${folder} std)
endfunction()

# patina_tool_library(<name> SOURCES <files> DEPS <folders> [PACKAGES <targets>]): what programs and tests outside src/patina
# share. Its headers are included with their folder: "recovery/recovery.h".
function(patina_tool_library name)
  patina_library(${name} ${ARGN})
  cmake_path(GET CMAKE_CURRENT_SOURCE_DIR PARENT_PATH parent)
  target_include_directories(patina_${name} PUBLIC "${parent}")
endfunction()

# patina_program(<name> SOURCES <files> DEPS <folders> [PACKAGES <targets>]): an executable in the build folder's root.
function(patina_program name)
  patina_executable(${name} std ${ARGN})
endfunction()

function(patina_executable name header)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;PACKAGES" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  list(TRANSFORM ARG_DEPS PREPEND patina_)
  target_link_libraries(${name} PRIVATE patina_options ${ARG_DEPS} ${ARG_PACKAGES})
  patina_finish_later(${name} ${header})
endfunction()

# patina_test(<folder> SOURCES <files> DEPS <folders> [PACKAGES <targets>]): one test program a folder, test_<folder>.
# Its own sources are compiled with -O1, in two thirds of the time: what takes long in a test is done by the library.
function(patina_test folder)
  patina_executable(test_${folder} test ${ARGN})
  target_compile_options(test_${folder} PRIVATE $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<NOT:$<CONFIG:Debug>>>:-O1>)
  target_link_libraries(test_${folder} PRIVATE patina_test_support GTest::gtest GTest::gtest_main)
  # Every case is a test of CTest's, asset.gltf_reader.refuses_...; the list is made when ctest starts, not in each build.
  # OpenMP's waiting threads sleep: spinning ones make tests a hundred times slower on a busy machine (nn/threads.h).
  gtest_discover_tests(test_${folder} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60 TEST_PREFIX "${folder}."
    WORKING_DIRECTORY "${CMAKE_SOURCE_DIR}" PROPERTIES ENVIRONMENT "OMP_WAIT_POLICY=passive")
  set_property(GLOBAL APPEND PROPERTY PATINA_TESTS ${folder})
endfunction()
