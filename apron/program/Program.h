// A compiled APRON program: an immutable list of instructions over registers (2-D arrays), variables
// (scalars), literals and texts. The compiler produces it, verify() proves it safe, and the VM executes it
// without further checks.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apron/program/CellType.h"

namespace apron::program {

enum class Opcode : std::uint8_t {
#define APRON_OP(name, mnemonic, signature, locality, text) k##name,
#include "apron/program/opcodes.def"
};
constexpr std::size_t index_of(Opcode op) noexcept { return static_cast<std::size_t>(op); }

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

// The cells beyond the edge for operations that read neighbours; the first operand of kBoundary, as a
// literal.
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
  // Index into the Program table of that kind; for a label, into Program::code.
  std::uint32_t index = 0;

  bool operator==(const Operand&) const = default;
};

struct Instruction {
  Opcode op = Opcode::kNop;
  // Writes to a register obey the active mask. The compiler clears this for temporaries, which are not
  // observable.
  bool masked = true;
  std::uint32_t source_location = 0;  // into Program::source_locations
  Operand destination;
  std::array<Operand, kMaxOperands> operands{};
};

struct Register {
  std::string name;  // as the user wrote it; temporaries begin with '$'
  std::uint32_t width = 0, height = 0;
  CellType type = CellType::kFloat32;
};

struct Variable {
  std::string name;
  float initial_value = 0.0F;
};

// A slider or switch that the script declares.
struct Parameter {
  std::string name;
  float default_value = 0.0F, low = 0.0F, high = 1.0F;
  bool is_switch = false;
};

// A filter's initial coefficients, row-major, row 0 north.
struct Filter {
  std::string name;
  std::uint32_t width = 0, height = 0;
  std::vector<float> coefficients;
};

// A place in the source.
struct SourceLocation {
  std::uint32_t file = 0;              // into Program::files
  std::uint32_t line = 0, column = 0;  // 1-based
  std::uint32_t expansion = 0;         // into Program::expansions; 0 if not inside a macro

  bool operator==(const SourceLocation&) const = default;
};

// A plugin's shared object, which the host finds by its name.
struct Module {
  std::string name;
  SourceLocation location;  // that names it first
};

// The registers or variables of a class in order, for instructions that select one by index or take all.
struct OperandGroup {
  std::string name;
  bool is_variable_group = false;
  std::vector<std::uint32_t> members;  // indices into registers or variables
};

// One expansion of a macro.
struct Expansion {
  std::string macro;
  SourceLocation call_site;  // may be inside an earlier expansion
  std::uint32_t operand_count = 0;
};

// The meaning of a local name of a macro or function, from one instruction up to another; for debuggers.
struct LocalName {
  std::string name;
  Operand operand;  // a register, variable or literal; none if the program holds no such value
  std::uint32_t first = 0, last = 0;
  // Elements of an array, if there is no operand. With an operand as their index, the name is that element.
  std::vector<Operand> elements = {};
  std::string text = {};  // of a parameter: its argument
};

struct Program {
  std::vector<Instruction> code;  // ends with kEnd
  std::vector<Register> registers;
  std::vector<Variable> variables;
  std::vector<double> literals;  // whole numbers up to 2^53 or 32-bit floats
  std::vector<std::string> texts;
  std::vector<Parameter> parameters;
  std::vector<Filter> filters;
  std::vector<OperandGroup> groups;
  std::vector<Module> modules;  // that are loaded before the program runs
  std::vector<SourceLocation> source_locations;
  std::vector<std::string> files;      // file names as shown to the user
  std::vector<Expansion> expansions;   // empty without macros; element 0 is a placeholder for "none"
  std::vector<LocalName> local_names;  // of inner macros first, the latest of a macro first
};

// Limits. Errors name the limit that was exceeded.
inline constexpr std::size_t kMaxInstructions = 1'000'000;
inline constexpr std::size_t kMaxRegisters = 4096;
inline constexpr std::size_t kMaxCells = std::size_t{1} << 26;  // per register
// Limit of all registers together.
inline constexpr std::size_t kMaxMemoryBytes = std::size_t{1} << (sizeof(std::size_t) == 8 ? 33 : 31);
inline constexpr std::size_t kMaxCallDepth = 256;
inline constexpr std::size_t kMaxMaskDepth = 64;
inline constexpr std::size_t kMaxFilterExtent = 255;                 // columns or rows
inline constexpr std::size_t kMaxStackDepth = 256;                   // registers pushed
inline constexpr std::size_t kMaxStackBytes = std::size_t{1} << 30;  // of all registers pushed
inline constexpr std::size_t kMaxPluginArguments = 16;               // per call

// Returns "" if the program is safe to execute, otherwise one line that names the instruction and the error.
// Checks that every operand is in range and of the kind that the opcode's signature takes, the registers of
// an instruction have one shape and type of cells, which the opcode takes, instructions that read neighbours
// do not work in place, labels are inside the code, masks balance on every path, the limits above hold, and
// the code ends with kEnd.
std::string verify(const Program&);

// One line per instruction: index, mnemonic, operands by name, source line. The operands must be in range.
std::string disassemble(const Program&);
std::string disassemble(const Program&, std::size_t instruction);
// A legend, then one line per instruction of the machine: mnemonic, operands, reach, what it does.
std::string instruction_table();

// The names of the registers and variables that the compiler creates begin with '$', and those of a macro's
// local names contain a ':'.
inline bool is_temporary(std::string_view name) noexcept { return name.empty() || name.front() == '$'; }
inline bool is_macro_name(std::string_view name) noexcept { return name.find(':') != std::string_view::npos; }
// A name that is in the program's text.
inline bool is_user_name(std::string_view name) noexcept {
  return !is_temporary(name) && !is_macro_name(name);
}
// The name without the suffix that makes a macro's local names unique.
inline std::string_view base_name(std::string_view name) noexcept { return name.substr(0, name.find(':')); }

// The source position of an instruction, or null if it is unknown.
const SourceLocation* find_location(const Program&, std::size_t instruction) noexcept;

// The number of cells of the largest register; 1 if there is none.
std::uint64_t max_register_cells(const Program&) noexcept;
// The index of the register of that name.
std::optional<std::size_t> find_register(const Program&, std::string_view name) noexcept;
// The local name that holds at an instruction, or null. A macro's parameter $a is also found as a.
const LocalName* find_local(const Program&, std::string_view name, std::size_t instruction) noexcept;
// "'NAME'", and a suggestion if a register has a similar name, for messages that there is none of that name.
std::string unknown_register(const Program&, const std::string& name);

// One line without a full stop if the program cannot have that value of a slider or switch, else "".
std::string parameter_problem(const Program&, const std::string& name, float value);

// True if the destination must not be a source as well, because the instruction reads other cells.
bool requires_out_of_place(Opcode) noexcept;

// True if the instruction takes registers of integers; kBitAnd to kSubSaturated take no others.
bool takes_integers(Opcode) noexcept;
constexpr bool takes_only_integers(Opcode op) noexcept {
  return op >= Opcode::kBitAnd && op <= Opcode::kSubSaturated;
}

}  // namespace apron::program
