// A compiled APRON program: an immutable list of instructions over registers (2-D float arrays), variables
// (scalars), literals and texts. The compiler makes it, verify() proves it safe to run, the VM runs it
// unchecked.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace apron::program {

enum class Opcode : std::uint8_t {
#define APRON_OP(name, mnemonic, signature, locality, text) k##name,
#include "apron/program/opcodes.def"
};

enum class Locality : std::uint8_t { Cell, News, Far, Global, Control, Host };

struct OpcodeInfo {
  std::string_view mnemonic;
  std::string_view signature;  // see opcodes.def
  Locality locality;
  std::string_view description;
};
inline constexpr std::size_t kMaxOperands = 3;

const OpcodeInfo& opcode_info(Opcode) noexcept;
std::size_t opcode_count() noexcept;

// Edge rule of the shifts, the first operand of kBoundary as a literal.
enum class BoundaryRule : std::uint8_t { kZero, kReplicate, kWrap, kReflect, kValue };

enum class OperandKind : std::uint8_t {
  kNone,
  kRegister,
  kVariable,
  kLiteral,
  kText,
  kLabel,
  kFilter,
  kGroup,
  kModule,
};

struct Operand {
  OperandKind kind = OperandKind::kNone;
  // Into registers, variables, literals, texts, filters, groups, modules; for a label: the instruction's
  // index.
  std::uint32_t index = 0;

  bool operator==(const Operand&) const = default;
};

struct Instruction {
  Opcode op = Opcode::kNop;
  // Writes to a register obey the active mask; the compiler clears it for temporaries, which nobody can see.
  bool masked = true;
  std::uint32_t source_location = 0;  // index into Program::source_locations
  Operand destination;
  std::array<Operand, kMaxOperands> operands{};
};

struct Register {
  std::string name;  // as the user wrote it; temporaries begin with '$'
  std::uint32_t width = 0, height = 0;
};

struct Variable {
  std::string name;
  float initial_value = 0.0F;
};

// A slider or switch that the script made.
struct Parameter {
  std::string name;
  float default_value = 0.0F, low = 0.0F, high = 1.0F;
  bool is_switch = false;
};

// Elements row by row, as they are before the program runs.
struct Filter {
  std::string name;
  std::uint32_t width = 0, height = 0;
  std::vector<float> coefficients;
};

// The elements of a class in their order, for instructions that take one by its number.
struct OperandGroup {
  std::string name;
  bool is_variable_group = false;
  std::vector<std::uint32_t> members;  // indices into registers or variables
};

// Where an instruction came from.
struct SourceLocation {
  std::uint32_t file = 0;              // index into Program::files
  std::uint32_t line = 0, column = 0;  // from 1
  std::uint32_t expansion = 0;         // index into Program::expansions; 0: not inside a macro

  bool operator==(const SourceLocation&) const = default;
};

// A use of a macro.
struct Expansion {
  std::string macro;
  SourceLocation call_site;  // inside another one, perhaps
};

struct Program {
  std::vector<Instruction> code;  // never empty: ends with kEnd
  std::vector<Register> registers;
  std::vector<Variable> variables;
  std::vector<float> literals;
  std::vector<std::string> texts;
  std::vector<Parameter> parameters;
  std::vector<Filter> filters;
  std::vector<OperandGroup> groups;
  std::vector<std::string> modules;  // shared objects by name, for the host to find
  std::vector<SourceLocation> source_locations;
  std::vector<std::string> files;     // as shown to the user
  std::vector<Expansion> expansions;  // empty without macros; the first stands for none
};

// Limits, named in the error when hit.
inline constexpr std::size_t kMaxInstructions = 1'000'000;
inline constexpr std::size_t kMaxRegisters = 4096;
inline constexpr std::size_t kMaxCells = std::size_t{1} << 26;        // of one register
inline constexpr std::size_t kMaxMemoryBytes = std::size_t{1} << 33;  // bytes of all registers
inline constexpr std::size_t kMaxCallDepth = 256;
inline constexpr std::size_t kMaxMaskDepth = 64;
inline constexpr std::size_t kMaxFilterExtent = 255;    // columns or rows
inline constexpr std::size_t kMaxStackDepth = 256;      // registers pushed
inline constexpr std::size_t kMaxPluginArguments = 16;  // of one call

// "" if every operand is in range and of the kind that its opcode's signature takes, the registers of one
// instruction share a shape, what reads neighbours is out of place, labels are inside the code, masks balance
// on every path and the code ends with kEnd; else one line that names the instruction and what is wrong with
// it.
std::string verify(const Program&);

// One line an instruction: index, mnemonic, operands by name, source line.
std::string disassemble(const Program&);
std::string disassemble(const Program&, std::size_t instruction);

// Whether the destination may not be a source too: what reads other cells than its own.
bool requires_out_of_place(Opcode) noexcept;

// What an instruction needs of the array: opcode's locality, with shifts judged by their offsets.
Locality locality(const Program&, const Instruction&) noexcept;

}  // namespace apron::program
