// A language server (Language Server Protocol 3.17) for APRON: diagnostics, hover, completion, definition,
// references, rename, symbols and formatting of the programs that an editor has open.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

namespace apron::language_server {

struct ServerOptions {
  std::uint32_t width = 64, height = 64;  // of the surface for which programs are compiled
  std::vector<std::string> include_paths;
  std::string library_path;
};

// Answers requests until the client asks it to exit or closes the input. Returns the exit status: 0 after a
// shutdown request, else 1. No message's contents end it; throws common::UserError if the stream of messages
// is broken.
int run_language_server(const ServerOptions&, std::istream& in, std::ostream& out);

}  // namespace apron::language_server
