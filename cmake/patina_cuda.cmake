# The cuda preset: patina against a LibTorch 2.x with CUDA (pip's torch package, or pytorch.org's archive).
# Included before find_package(Torch), which then enables the CUDA language and turns TORCH_CUDA_ARCH_LIST into
# nvcc's -gencode flags.

# Ampere's code runs on Ada too; Hopper's own is kept with its PTX for what comes after it.
set(TORCH_CUDA_ARCH_LIST "8.0;9.0+PTX" CACHE STRING "Compute capabilities to compile for, as torch lists them")

# CMake before 3.26 does not know that nvcc takes it.
if(NOT DEFINED CMAKE_CUDA20_STANDARD_COMPILE_OPTION)
  set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION "-std=c++20")
  set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION "-std=c++20")
endif()

find_path(PATINA_TORCH_PREFIX share/cmake/Torch/TorchConfig.cmake
  PATHS ${CMAKE_PREFIX_PATH} PATH_SUFFIXES ../.. NO_DEFAULT_PATH
  DOC "Folder of LibTorch 2.x that holds include, lib and share")
if(NOT PATINA_TORCH_PREFIX)
  message(FATAL_ERROR "PATINA_CUDA needs a LibTorch 2.x with CUDA: give -DCMAKE_PREFIX_PATH=<torch>/share/cmake, "
    "where <torch> is what `python3 -c 'import torch; print(torch.__path__[0])'` prints.")
endif()

# TorchConfig.cmake looks for these by name, in the system's folders first: a LibTorch of another version installed there
# would be linked beside the one that was asked for.
foreach(name torch c10 c10_cuda)
  string(TOUPPER ${name} upper)
  foreach(variable ${name}_LIBRARY ${upper}_LIBRARY)
    find_library(${variable} ${name} PATHS "${PATINA_TORCH_PREFIX}/lib" NO_DEFAULT_PATH NO_CACHE)
    set(${variable} "${${variable}}" CACHE FILEPATH "Of the LibTorch in PATINA_TORCH_PREFIX" FORCE)
  endforeach()
endforeach()

# pip's LibTorch brings the CUDA runtime, NCCL, cuBLAS and the like in folders beside it. Linker and loader must look there
# first: a toolkit's folder may hold older ones.
file(GLOB patina_torch_needs LIST_DIRECTORIES true "${PATINA_TORCH_PREFIX}/../nvidia/*/lib")
foreach(folder ${patina_torch_needs})
  file(REAL_PATH "${folder}" folder)
  add_link_options("LINKER:-rpath-link,${folder}")
  list(APPEND CMAKE_BUILD_RPATH "${folder}")
endforeach()

# LibTorch 2.x brings headers of its own fmt, which would be compiled against and not linked: patina_options puts this
# folder first (patina.cmake).
find_path(PATINA_FMT_INCLUDE fmt/format.h PATHS /usr/include REQUIRED NO_CMAKE_PATH)
file(MAKE_DIRECTORY "${CMAKE_BINARY_DIR}/include_first")
file(CREATE_LINK "${PATINA_FMT_INCLUDE}/fmt" "${CMAKE_BINARY_DIR}/include_first/fmt" SYMBOLIC)

# One CUDA runtime in the process: the one that LibTorch loads.
set(CMAKE_CUDA_RUNTIME_LIBRARY Shared)

if(PATINA_CCACHE)
  set(CMAKE_CUDA_COMPILER_LAUNCHER "${PATINA_CCACHE}")
endif()
