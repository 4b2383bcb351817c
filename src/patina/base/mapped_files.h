// Which file a page of memory belongs to, of those that are mapped (files.h).
#pragma once

namespace patina {

/// Name of the file of which a MappedFile holds the page at `address`, null for other memory. For a program's
/// handler of SIGBUS, which reading such a page raises when the file has become shorter or its disk fails:
/// takes no lock and allocates nothing.
const char* mapped_file_at(const void* address);

}  // namespace patina
