#include "apron/run/ui/ConditionCompiler.h"

#include <algorithm>
#include <cctype>

#include "apron/compiler/Compiler.h"
#include "apron/debugger/Condition.h"
#include "apron/vm/NumberFormat.h"

namespace apron::run {
namespace {

bool is_identifier_character(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return std::isalnum(byte) != 0 || byte >= 0x80 || c == '_' || c == '.';
}

// Where the name occurs next as a whole word; npos if it does not, as compiler-generated names never do.
std::size_t find_word(const std::string& text, const std::string& name, std::size_t from = 0) {
  if (!program::is_user_name(name)) return std::string::npos;
  for (std::size_t position = text.find(name, from); position != std::string::npos;
       position = text.find(name, position + 1)) {
    const std::size_t end = position + name.size();
    if ((position == 0 || !is_identifier_character(text[position - 1])) &&
        (end == text.size() || !is_identifier_character(text[end])))
      return position;
  }
  return std::string::npos;
}

bool mentions(const std::string& text, const std::string& name) {
  return find_word(text, name) != std::string::npos;
}

// Registers of another size, which the debugger knows by their names alone, are elements of a class in the
// language.
std::string with_elements(std::string condition, const program::Program& debuggee, std::uint32_t width,
                          std::uint32_t height) {
  for (const program::Register& r : debuggee.registers) {
    if (r.width == width && r.height == height) continue;
    const std::string element = "REGISTER[" + r.name + "]";
    for (std::size_t at = find_word(condition, r.name); at != std::string::npos;) {
      const bool is_element = at > 0 && condition[at - 1] == '[';
      if (!is_element) condition.replace(at, r.name.size(), element);
      at = find_word(condition, r.name, at + (is_element ? r.name.size() : element.size()));
    }
  }
  return condition;
}

// Declares the registers and scalars of the debuggee that the condition names.
std::string condition_declarations(const std::string& condition, const program::Program& debuggee,
                                   std::uint32_t width, std::uint32_t height) {
  std::string text;
  std::vector<std::string> declared;
  const auto declare_once = [&](const std::string& name) {
    if (!mentions(condition, name) || std::ranges::find(declared, name) != declared.end()) return false;
    declared.push_back(name);
    return true;
  };
  // For "ch[2]" the whole array is declared, "ch[3]" for three elements.
  const auto declaration = [&](const auto& all, const std::string& name) -> std::string {
    const std::string array = name.substr(0, name.find('['));
    if (!declare_once(array)) return "";
    const auto is_element = [&](const auto& one) { return one.name.starts_with(array + "["); };
    return array == name ? name : array + "[" + std::to_string(std::ranges::count_if(all, is_element)) + "]";
  };
  for (const program::Register& r : debuggee.registers) {
    const std::string name = declaration(debuggee.registers, r.name);
    if (name.empty()) continue;
    const std::string type(program::cell_type_name(r.type));
    if (r.width == width && r.height == height)
      text += "!" + (program::is_integer(r.type) ? type : "register") + "(" + name + ")\n";
    else
      text += "!create('" + name + "', REGISTER, " + std::to_string(r.width) + ", " +
              std::to_string(r.height) + ", " + type + ")\n";
  }
  for (const program::Variable& v : debuggee.variables)
    if (const std::string name = declaration(debuggee.variables, v.name); !name.empty())
      text += "!scalar(" + name + ")\n";
  return text;
}

compiler::CompileResult compile_text(const std::string& text, std::uint32_t width, std::uint32_t height) {
  syntax::MemoryReader reader;
  reader.files["condition"] = text;
  compiler::CompileOptions options;
  options.file = "condition";
  options.width = width;
  options.height = height;
  return compiler::compile(options, reader);
}

// The error of a cell outside of its register, if its place is constant; "" if there is none.
std::string outside_error(const program::Program& condition) {
  const auto constant = [&](const program::Operand& operand) -> std::optional<double> {
    if (operand.kind != program::OperandKind::kLiteral) return std::nullopt;
    return condition.literals[operand.index];
  };
  for (const program::Instruction& instruction : condition.code) {
    if (instruction.op != program::Opcode::kPixelGet) continue;
    const program::Register& cells = condition.registers[instruction.operands[0].index];
    const auto column = constant(instruction.operands[1]), row = constant(instruction.operands[2]);
    const auto is_outside = [](const std::optional<double>& at, std::uint32_t length) {
      return at && !(*at >= 0.0 && *at < length);
    };
    if (!is_outside(column, cells.width) && !is_outside(row, cells.height)) continue;
    const auto place = [](const char* axis, const std::optional<double>& at) {
      return at ? std::string(axis) + " " + vm::format_number(*at) : std::string();
    };
    return place("column", column) + (column && row ? ", " : "") + place("row", row) +
           " is outside a register of " + std::to_string(cells.width) + "x" + std::to_string(cells.height);
  }
  return "";
}

}  // namespace

std::optional<program::Program> compile_condition(const std::string& text, const program::Program& debuggee,
                                                  std::uint32_t width, std::uint32_t height,
                                                  std::string& error) {
  if (text.find_first_of("\r\n\\") != std::string::npos || text.find("//") != std::string::npos) {
    error = "a condition must be one line without a comment";
    return std::nullopt;
  }
  const std::string condition = with_elements(text, debuggee, width, height);
  const std::string declarations = condition_declarations(condition, debuggee, width, height);
  compiler::CompileResult result = compile_text(declarations + "#again\n" + debugger::kResultVariable +
                                                    " = " + condition + "\nsurface.step\njump(#again)\n",
                                                width, height);
  if (result.program) {
    error = outside_error(*result.program);
    return error.empty() ? std::move(result.program) : std::nullopt;
  }
  // Recompiles as an if statement, so that the message does not name the result variable.
  const compiler::CompileResult statement =
      compile_text(declarations + "if(" + condition + ")\nendif\n", width, height);
  const auto& diagnostics = statement.program ? result.diagnostics : statement.diagnostics;
  error = diagnostics.empty() ? "not a condition" : diagnostics.front().message;
  return std::nullopt;
}

}  // namespace apron::run
