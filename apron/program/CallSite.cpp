#include "apron/program/CallSite.h"

namespace apron::program {

std::string format_call_site(const Program& program, std::size_t instruction) {
  const SourceLocation* source = find_location(program, instruction);
  return source == nullptr ? "" : format_call_site(program, *source);
}

std::string format_call_site(const Program& program, const SourceLocation& place) {
  const SourceLocation* source = &place;
  while (source->expansion != 0) source = &program.expansions[source->expansion].call_site;
  return program.files[source->file] + ":" + std::to_string(source->line) + ": ";
}

}  // namespace apron::program
