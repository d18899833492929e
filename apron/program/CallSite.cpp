#include "apron/program/CallSite.h"

namespace apron::program {

std::string format_call_site(const Program& program, std::size_t instruction) {
  const SourceLocation* source = find_location(program, instruction);
  if (source == nullptr) return {};
  while (source->expansion != 0) source = &program.expansions[source->expansion].call_site;
  return program.files[source->file] + ":" + std::to_string(source->line) + ": ";
}

}  // namespace apron::program
