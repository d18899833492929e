// `apron lsp`.
#include <iostream>

#include "apron/language_server/LanguageServer.h"
#include "apron/run/cli/Commands.h"
#include "apron/run/options/CompiledProgram.h"

namespace apron::run {

int serve_editors(const Options& options) {
  const language_server::ServerOptions server{options.width, options.height, options.include_paths,
                                              library_path()};
  return language_server::run_language_server(server, std::cin, std::cout);
}

}  // namespace apron::run
