#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "apron/program/MaskVerifier.h"
#include "apron/program/Program.h"

namespace apron::program {
namespace {

using Kind = OperandKind;

// Checks one instruction. verify() and every check return "" or a description of the error.
class InstructionVerifier {
 public:
  InstructionVerifier(const Program& program, const Instruction& instruction)
      : program_(program), instruction_(instruction), signature_(opcode_info(instruction.op).signature) {}

  std::string verify() {
    if (instruction_.source_location >= program_.source_locations.size() &&
        !program_.source_locations.empty())
      return "its source is out of range";
    if (auto error = check_destination(); !error.empty()) return error;
    for (std::size_t i = 0; i < kMaxOperands; ++i) {
      if (auto error = check_source(i); !error.empty()) return error;
    }
    if (auto error = check_shapes(); !error.empty()) return error;
    if (auto error = check_types(); !error.empty()) return error;
    return check_opcode();
  }

 private:
  std::size_t table_size(Kind kind) const {
    switch (kind) {
      case Kind::kNone:
        return SIZE_MAX;
      case Kind::kRegister:
        return program_.registers.size();
      case Kind::kVariable:
        return program_.variables.size();
      case Kind::kLiteral:
        return program_.literals.size();
      case Kind::kText:
        return program_.texts.size();
      case Kind::kLabel:
        return program_.code.size();
      case Kind::kFilter:
        return program_.filters.size();
      case Kind::kGroup:
        return program_.groups.size();
      case Kind::kModule:
        return program_.modules.size();
    }
    return 0;
  }

  static bool accepts(char letter, Kind kind) {
    // A damaged program may have any number as a kind; an invalid one has no bit.
    constexpr auto kBit = [](Kind k) {
      return static_cast<unsigned>(k) < 32 ? 1U << static_cast<unsigned>(k) : 0U;
    };
    constexpr unsigned kRegister = kBit(Kind::kRegister), kVariable = kBit(Kind::kVariable),
                       kScalar = kVariable | kBit(Kind::kLiteral);
    static constexpr std::pair<char, unsigned> kAccepted[] = {{'R', kRegister},
                                                              {'V', kVariable},
                                                              {'D', kRegister | kVariable},
                                                              {'I', kRegister | kVariable},
                                                              {'E', kRegister | kVariable},
                                                              {'r', kRegister},
                                                              {'a', kRegister},
                                                              {'s', kScalar},
                                                              {'x', kScalar | kRegister},
                                                              {'t', kBit(Kind::kText)},
                                                              {'l', kBit(Kind::kLabel)},
                                                              {'k', kBit(Kind::kFilter)},
                                                              {'g', kBit(Kind::kGroup)},
                                                              {'m', kBit(Kind::kModule)},
                                                              {'-', kBit(Kind::kNone)}};
    return (std::ranges::find(kAccepted, letter, &std::pair<char, unsigned>::first)->second & kBit(kind)) !=
           0;
  }

  std::string check_operand(char letter, const Operand& operand, std::string_view what) const {
    if (!accepts(letter, operand.kind)) return fmt::format("{} is not of kind '{}'", what, letter);
    if (operand.index >= table_size(operand.kind)) return fmt::format("{} is out of range", what);
    return {};
  }

  std::string check_destination() const {
    return check_operand(signature_.front(), instruction_.destination, "the destination");
  }

  std::string check_source(std::size_t i) const {
    const char letter = i + 1 < signature_.size() ? signature_[i + 1] : '-';
    return check_operand(letter, instruction_.operands[i], fmt::format("operand {}", i + 1));
  }

  std::string check_shapes() const {
    const Register* shape = nullptr;
    const auto differs = [&](const Operand& operand) {
      if (operand.kind != Kind::kRegister) return false;
      const Register& reg = program_.registers[operand.index];
      if (shape == nullptr) shape = &reg;
      return !same_shape(*shape, reg);
    };
    const bool to_variable = (signature_.front() == 'D' || signature_.front() == 'I') &&
                             instruction_.destination.kind == Kind::kVariable;
    // A scatter gathers the cells of its operands in a register of any shape.
    bool mismatch = instruction_.op != Opcode::kScatter && differs(instruction_.destination);
    for (const Operand& operand : instruction_.operands) {
      if (to_variable && operand.kind == Kind::kRegister) return "a register cannot go into a variable";
      mismatch = mismatch || differs(operand);
    }
    return mismatch ? "its registers differ in shape" : "";
  }

  // The registers have one type of cells, which the opcode takes, and literals are values of it.
  std::string check_types() const {
    const Register* first = nullptr;
    bool mixed = false;
    const auto visit = [&](const Operand& operand) {
      if (operand.kind != Kind::kRegister) return;
      const Register& reg = program_.registers[operand.index];
      if (first == nullptr) first = &reg;
      mixed = mixed || reg.type != first->type;
    };
    visit(instruction_.destination);
    for (std::size_t i = 0; i + 1 < signature_.size(); ++i)
      if (signature_[i + 1] != 'a') visit(instruction_.operands[i]);
    if (first == nullptr) return {};
    if (instruction_.op == Opcode::kConvert || instruction_.op == Opcode::kConvertSaturated)
      return mixed ? "" : "it converts a register to its own type";
    if (mixed) return "its registers differ in type";
    if (instruction_.op == Opcode::kSpreadNumber && first->type != CellType::kInt32)
      return "it gives a register of int32";
    if (is_integer(first->type) && !takes_integers(instruction_.op))
      return "it takes no registers of integers";
    if (!is_integer(first->type) && takes_only_integers(instruction_.op))
      return "it takes registers of integers";
    if (instruction_.op > Opcode::kSubSaturated) return {};
    for (const Operand& operand : instruction_.operands)
      if (operand.kind == Kind::kLiteral && !is_cell_value(first->type, program_.literals[operand.index]))
        return fmt::format("its literal is no {}", cell_type_name(first->type));
    return {};
  }

  bool is_integer_literal(const Operand& operand) const {
    if (operand.kind != Kind::kLiteral) return false;
    const double value = program_.literals[operand.index];
    return std::fabs(value) <= 16777216.0F && value == std::trunc(value);
  }

  std::string check_opcode() const {
    if (requires_out_of_place(instruction_.op) &&
        std::ranges::find(instruction_.operands, instruction_.destination) != instruction_.operands.end()) {
      return "it is not out of place";
    }
    switch (instruction_.op) {
      case Opcode::kShift:
      case Opcode::kRotate:
        for (const std::size_t k : {1U, 2U}) {
          const Operand& offset = instruction_.operands[k];
          if (offset.kind == Kind::kLiteral && !is_integer_literal(offset)) return "its offset is not whole";
        }
        return {};
      case Opcode::kBoundary:
        return check_boundary();
      case Opcode::kParameter:
        return check_parameter();
      case Opcode::kNearSum:
      case Opcode::kNearMin:
      case Opcode::kNearMax:
      case Opcode::kNearAny:
      case Opcode::kNearAll:
        return check_neighbourhood();
      case Opcode::kResGetVar:
      case Opcode::kResSetVar:
        return check_group(true);
      case Opcode::kResGetReg:
      case Opcode::kResSetReg:
        return check_group(false);
      case Opcode::kMatrixProduct:
        return check_matrix_product();
      default:
        return {};
    }
  }

  std::string check_boundary() const {
    if (!is_integer_literal(instruction_.operands[0])) return "its rule is not a whole literal";
    const double rule = program_.literals[instruction_.operands[0].index];
    const bool known = rule >= 0.0F && rule <= static_cast<double>(BoundaryRule::kValue);
    return known ? "" : "its rule is unknown";
  }

  std::string check_neighbourhood() const {
    const Operand& count = instruction_.operands[1];
    if (!is_integer_literal(count)) return "its neighbourhood is not a whole literal";
    const double value = program_.literals[count.index];
    return value == 4.0F || value == 8.0F ? "" : "its neighbourhood is not 4 or 8";
  }

  std::string check_group(bool of_variables) const {
    return program_.groups[instruction_.operands[0].index].is_variable_group == of_variables
               ? ""
               : "its class is of another kind";
  }

  // Registers of floats and of one shape, none in both classes, and a scalar for each pair of them.
  std::string check_matrix_product() const {
    const auto& [to, from, weights] = instruction_.operands;
    const OperandGroup &y = program_.groups[to.index], &x = program_.groups[from.index];
    if (y.is_variable_group || x.is_variable_group || !program_.groups[weights.index].is_variable_group)
      return "its class is of another kind";
    if (y.members.empty() || x.members.empty() ||
        program_.groups[weights.index].members.size() != y.members.size() * x.members.size())
      return "it has not one scalar for each pair of its registers";
    for (const OperandGroup* group : {&y, &x})
      for (const std::uint32_t member : group->members) {
        const Register& reg = program_.registers[member];
        if (is_integer(reg.type)) return "it takes no registers of integers";
        if (!same_shape(reg, program_.registers[y.members.front()])) return "its registers differ in shape";
      }
    for (const std::uint32_t member : y.members)
      if (std::ranges::find(x.members, member) != x.members.end()) return "it is not out of place";
    return {};
  }

  std::string check_parameter() const {
    const std::string& name = program_.texts[instruction_.operands[0].index];
    const bool known = std::ranges::any_of(
        program_.parameters, [&](const Parameter& parameter) { return parameter.name == name; });
    return known ? "" : fmt::format("no parameter is called '{}'", name);
  }

  const Program& program_;
  const Instruction& instruction_;
  std::string_view signature_;
};

std::string verify_registers(const Program& program) {
  if (program.registers.size() > kMaxRegisters) {
    return fmt::format("the program has more than {} registers", kMaxRegisters);
  }
  std::uint64_t memory = 0;
  for (const Register& reg : program.registers) {
    const std::uint64_t cells = std::uint64_t{reg.width} * reg.height;
    if (cells == 0) return fmt::format("register '{}' has no cells", reg.name);
    if (cells > kMaxCells) return fmt::format("register '{}' has more than {} cells", reg.name, kMaxCells);
    if (index_of(reg.type) >= kCellTypeCount)
      return fmt::format("register '{}' has cells of an unknown type", reg.name);
    memory += stored_bytes(reg.width, reg.height, reg.type);
  }
  return memory > kMaxMemoryBytes ? fmt::format("the registers take more than {} bytes", kMaxMemoryBytes)
                                  : "";
}

std::string verify_tables(const Program& program) {
  for (const Filter& filter : program.filters) {
    const std::size_t side = std::max(filter.width, filter.height);
    if (side == 0 || side > kMaxFilterExtent ||
        filter.coefficients.size() != std::size_t{filter.width} * filter.height) {
      return fmt::format("the filter '{}' is not of 1x1 to {}x{} elements", filter.name, kMaxFilterExtent,
                         kMaxFilterExtent);
    }
  }
  for (const OperandGroup& group : program.groups) {
    const std::size_t limit = group.is_variable_group ? program.variables.size() : program.registers.size();
    for (const std::uint32_t element : group.members)
      if (element >= limit) return fmt::format("the class '{}' has an element out of range", group.name);
  }
  return {};
}

std::string verify_sources(const Program& program) {
  const auto bad_file = [&](const SourceLocation& s) { return s.file >= program.files.size(); };
  for (const SourceLocation& source : program.source_locations) {
    if (bad_file(source)) return "a source names a file out of range";
    if (source.expansion > 0 && source.expansion >= program.expansions.size())
      return "a source names an expansion out of range";
  }
  for (std::size_t i = 1; i < program.expansions.size(); ++i) {
    const SourceLocation& call = program.expansions[i].call_site;
    // Each call site is outside macros or inside an earlier expansion, so that chains terminate.
    if (bad_file(call) || call.expansion >= i) return "an expansion's call is out of range";
  }
  return {};
}

}  // namespace

std::string verify(const Program& program) {
  if (program.code.empty()) return "the program has no instructions";
  if (program.code.size() > kMaxInstructions) {
    return fmt::format("the program has more than {} instructions", kMaxInstructions);
  }
  if (auto error = verify_registers(program); !error.empty()) return error;
  if (auto error = verify_tables(program); !error.empty()) return error;
  if (auto error = verify_sources(program); !error.empty()) return error;
  for (std::size_t i = 0; i < program.code.size(); ++i) {
    const Instruction& instruction = program.code[i];
    if (index_of(instruction.op) >= opcode_count()) {
      return fmt::format("instruction {}: unknown opcode", i);
    }
    if (auto error = InstructionVerifier(program, instruction).verify(); !error.empty()) {
      return fmt::format("instruction {} ({}): {}", i, opcode_info(instruction.op).mnemonic, error);
    }
  }
  if (program.code.back().op != Opcode::kEnd) return "the program does not end with 'end'";
  return verify_masks(program);
}

}  // namespace apron::program
