#include "apron/program/CallSite.h"

namespace apron::program {

std::string format_call_site(const Program& program, std::size_t instruction) {
  const SourceLocation* source = find_location(program, instruction);
  if (source == nullptr) return {};
  while (source->expansion != 0) source = &program.expansions[source->expansion].call_site;
  return program.files[source->file] + ":" + std::to_string(source->line) + ": ";
}

std::string format_module_call(const Program& program, std::size_t module) {
  for (std::size_t i = 0; i < program.code.size(); ++i)
    for (const Operand& operand : program.code[i].operands)
      if (operand.kind == OperandKind::kModule && operand.index == module)
        return format_call_site(program, i);
  return {};
}

}  // namespace apron::program
