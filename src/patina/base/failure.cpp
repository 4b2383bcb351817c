#include "patina/base/failure.h"

#include <exception>
#include <filesystem>
#include <new>
#include <system_error>

#include <fmt/format.h>

namespace patina {

std::string as_text(const Failure& failure) {
  return (failure.about.empty() ? "" : failure.about + ": ") + failure.text;
}

Failure current_failure() {
  try {
    throw;
  } catch (const Error& e) {
    return {name_of(e.code()), printable(e.context(), 500), printable(e.message(), 2000)};
  } catch (const std::filesystem::filesystem_error& e) {  // link loops, folders that may not be read
    const std::string path = e.path2().empty() ? e.path1().string() : e.path2().string();
    return {name_of(ErrorCode::kIo), printable(path, 500), e.code().message()};
  } catch (const std::system_error& e) {
    return {name_of(ErrorCode::kDevice), "",
            fmt::format("the system refuses a thread or a lock ({}); is a limit reached (ulimit -u, -v)? "
                        "Fewer threads need less",
                        e.code().message())};
  } catch (const std::bad_alloc&) {
    return {name_of(ErrorCode::kDevice), "",
            "out of memory; use fewer views (4), smaller ones (256 pixels) or smaller textures (1024)"};
  } catch (const std::exception& e) {
    return {"fault", "", printable(e.what(), 2000)};
  } catch (...) {
    return {"fault", "", "an exception of no known type"};
  }
}

}  // namespace patina
