# LibTorch's headers cost more than most of our sources. They are compiled once, into a precompiled header that every source
# which sees them begins with; other sources go without it, since loading it costs more than it saves them.
# -DPATINA_PCH=OFF builds without, which finds sources that do not include what they use.
option(PATINA_PCH "Precompile the headers of LibTorch" ON)

if(PATINA_PCH)
  file(WRITE "${CMAKE_BINARY_DIR}/torch_pch.cpp.in" "// Only there to own the precompiled header.\n")
  file(COPY_FILE "${CMAKE_BINARY_DIR}/torch_pch.cpp.in" "${CMAKE_BINARY_DIR}/torch_pch.cpp" ONLY_IF_DIFFERENT)
  add_library(patina_torch_pch OBJECT "${CMAKE_BINARY_DIR}/torch_pch.cpp")
  target_link_libraries(patina_torch_pch PRIVATE patina_options patina_torch)
  target_compile_options(patina_torch_pch PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-fPIC>)
  target_precompile_headers(patina_torch_pch PRIVATE <ATen/ATen.h> <c10/core/InferenceMode.h>)
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

# patina_use_torch_pch(<target>): called at the end of the target's folder, when all its sources are known. A source with
# compiler options of its own cannot use what was compiled without them.
function(patina_use_torch_pch target)
  get_target_property(sources ${target} SOURCES)
  set(uses NO)
  foreach(source ${sources})
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE OUTPUT_VARIABLE path)
    get_source_file_property(options "${source}" COMPILE_OPTIONS)
    patina_sees_torch("${path}" sees)
    if(sees AND NOT options)
      set(uses YES)
    else()
      set_source_files_properties("${source}" PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
    endif()
  endforeach()
  if(uses)
    target_precompile_headers(${target} REUSE_FROM patina_torch_pch)
    # The header was compiled as position-independent as a library is, and must be used so; ccache wants the second. A source
    # that cannot use the header for other reasons is compiled without: slower, and with a warning.
    target_compile_options(${target} PRIVATE
      "$<$<COMPILE_LANGUAGE:CXX>:-fPIC;-fpch-preprocess;-Wno-error=invalid-pch>")
  endif()
endfunction()
