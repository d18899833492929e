#include "apron/run/ui/ConditionCompiler.h"

#include <algorithm>
#include <cctype>

#include "apron/compiler/Compiler.h"
#include "apron/debugger/Condition.h"

namespace apron::run {
namespace {

bool is_identifier_character(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.';
}

// True if the text contains the name as a whole word; false for compiler-generated names.
bool mentions(const std::string& text, const std::string& name) {
  if (name.empty() || name.front() == '$' || name.find(':') != std::string::npos) return false;
  for (std::size_t position = text.find(name); position != std::string::npos;
       position = text.find(name, position + 1)) {
    const std::size_t end = position + name.size();
    if ((position == 0 || !is_identifier_character(text[position - 1])) &&
        (end == text.size() || !is_identifier_character(text[end])))
      return true;
  }
  return false;
}

std::string condition_source(const std::string& condition, const program::Program& debuggee,
                             std::uint32_t width, std::uint32_t height) {
  std::string text;
  std::vector<std::string> declared;
  const auto declare_once = [&](const std::string& name) {
    if (!mentions(condition, name) || std::ranges::find(declared, name) != declared.end()) return false;
    declared.push_back(name);
    return true;
  };
  // Of "ch[2]" the whole array is declared, "ch[3]" for three elements.
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
  return text + "#again\n" + debugger::kResultVariable + " = " + condition + "\nsurface.step\njump(#again)\n";
}

}  // namespace

std::optional<program::Program> compile_condition(const std::string& condition,
                                                  const program::Program& debuggee, std::uint32_t width,
                                                  std::uint32_t height, std::string& error) {
  if (condition.find_first_of("\r\n\\") != std::string::npos || condition.find("//") != std::string::npos) {
    error = "a condition must be one line without a comment";
    return std::nullopt;
  }
  syntax::MemoryReader reader;
  reader.files["condition"] = condition_source(condition, debuggee, width, height);
  compiler::CompileOptions compiler_options;
  compiler_options.file = "condition";
  compiler_options.width = width;
  compiler_options.height = height;
  compiler::CompileResult result = compiler::compile(compiler_options, reader);
  if (result.program) return std::move(result.program);
  error = result.diagnostics.empty() ? "not a condition" : result.diagnostics.front().message;
  return std::nullopt;
}

}  // namespace apron::run
