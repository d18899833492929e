#include "apron/program/Program.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/text/Suggestion.h"
#include "common/text/Words.h"

namespace apron::program {
namespace {

constexpr OpcodeInfo kOpcodeTable[] = {
#define APRON_OP(name, mnemonic, signature, locality, text) {mnemonic, signature, Locality::locality, text},
#include "apron/program/opcodes.def"
};

}  // namespace

const OpcodeInfo& opcode_info(Opcode op) noexcept { return kOpcodeTable[index_of(op)]; }

bool requires_out_of_place(Opcode op) noexcept {
  return op == Opcode::kShift || op == Opcode::kRotate ||
         (op >= Opcode::kNearSum && op <= Opcode::kNearAll) || op == Opcode::kFilterDo ||
         (op >= Opcode::kFlood && op <= Opcode::kSpreadNumber);
}

bool takes_integers(Opcode op) noexcept {
  if (op <= Opcode::kSubSaturated) return op != Opcode::kPow && op != Opcode::kAtan2;
  switch (op) {
    case Opcode::kConvert:
    case Opcode::kConvertSaturated:
    case Opcode::kShift:
    case Opcode::kRotate:
    case Opcode::kMaskOn:
    case Opcode::kMaskPush:
    case Opcode::kPixelGet:
    case Opcode::kPixelSet:
    case Opcode::kStackPush:
    case Opcode::kStackPop:
    case Opcode::kResGetReg:
    case Opcode::kResSetReg:
    case Opcode::kFilterDo:
    case Opcode::kFlood:
    case Opcode::kSpreadMax:
    case Opcode::kSpreadSum:
    case Opcode::kSpreadNumber:
    case Opcode::kScatter:
    case Opcode::kRandomInt:
      return true;
    case Opcode::kPluginWith:
    case Opcode::kPlugin:
      return false;
    default:
      return (op >= Opcode::kNearSum && op <= Opcode::kNearAll) ||
             (op >= Opcode::kGlobalSum && op <= Opcode::kGlobalAny) ||
             opcode_info(op).locality == Locality::Host;
  }
}

std::size_t opcode_count() noexcept { return std::size(kOpcodeTable); }

const SourceLocation* find_location(const Program& program, std::size_t instruction) noexcept {
  if (instruction >= program.code.size()) return nullptr;
  const std::uint32_t index = program.code[instruction].source_location;
  return index < program.source_locations.size() ? &program.source_locations[index] : nullptr;
}

std::uint64_t max_register_cells(const Program& program) noexcept {
  std::uint64_t cells = 1;
  for (const Register& r : program.registers) cells = std::max(cells, std::uint64_t{r.width} * r.height);
  return cells;
}

std::optional<std::size_t> find_register(const Program& program, std::string_view name) noexcept {
  const auto found = std::ranges::find(program.registers, name, &Register::name);
  if (found == program.registers.end()) return std::nullopt;
  return found - program.registers.begin();
}

const LocalName* find_local(const Program& program, std::string_view name, std::size_t instruction) noexcept {
  const auto found = std::ranges::find_if(program.local_names, [&](const LocalName& local) {
    const bool is_named =
        local.name == name || (local.name.starts_with('$') && std::string_view(local.name).substr(1) == name);
    return is_named && local.first <= instruction && instruction < local.last;
  });
  return found == program.local_names.end() ? nullptr : &*found;
}

std::string unknown_register(const Program& program, const std::string& name) {
  std::vector<std::string> known;
  for (const Register& reg : program.registers)
    if (!is_temporary(reg.name)) known.push_back(reg.name);
  return "'" + name + "'" + common::did_you_mean(name, known);
}

std::string parameter_problem(const Program& program, const std::string& name, float value) {
  const auto found = std::ranges::find(program.parameters, name, &Parameter::name);
  if (found == program.parameters.end()) {
    const std::string known = common::join(program.parameters, &Parameter::name);
    return fmt::format("the program has no slider or switch '{}'; it has {}", name,
                       known.empty() ? "none" : known);
  }
  if (found->is_switch && value != 0.0F && value != 1.0F)
    return fmt::format("the switch '{}' is 0 or 1, not {}", name, value);
  if (!(found->low <= value && value <= found->high))
    return fmt::format("'{}' = {} is not from {} to {}", name, value, found->low, found->high);
  return "";
}

}  // namespace apron::program
