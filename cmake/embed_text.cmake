# Writes OUTPUT, a C++ source that defines NAME (patina/report/page_files.h) as the text of INPUT:
#   cmake -DINPUT=page.css -DOUTPUT=page.css.cpp -DNAME=kPageStyle -P embed_text.cmake
file(READ "${INPUT}" text)
set(mark "patina_text")
if(text MATCHES "\\)${mark}\"")
  message(FATAL_ERROR "${INPUT} holds the mark that ends a raw string: )${mark}\"")
endif()
get_filename_component(name "${INPUT}" NAME)
file(WRITE "${OUTPUT}" "// Made from ${name}.\n#include \"patina/report/page_files.h\"\n\n"
  "namespace patina::report {\n\nconst std::string_view ${NAME} = R\"${mark}(${text})${mark}\";\n\n"
  "}  // namespace patina::report\n")
