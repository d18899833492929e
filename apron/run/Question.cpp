#include "apron/run/Question.h"

#include <algorithm>
#include <cctype>

#include "apron/compiler/Compiler.h"
#include "apron/debugger/Condition.h"

namespace apron::run {
namespace {

bool is_name_character(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.';
}

// Whether the name stands in the text as a word; names that the compiler made stand in none.
bool names(const std::string& text, const std::string& name) {
  if (name.empty() || name.front() == '$' || name.find(':') != std::string::npos) return false;
  for (std::size_t at = text.find(name); at != std::string::npos; at = text.find(name, at + 1)) {
    const std::size_t end = at + name.size();
    if ((at == 0 || !is_name_character(text[at - 1])) &&
        (end == text.size() || !is_name_character(text[end])))
      return true;
  }
  return false;
}

std::string question(const std::string& condition, const program::Program& watched, std::uint32_t width,
                     std::uint32_t height) {
  std::string text;
  std::vector<std::string> declared;
  const auto fresh = [&](const std::string& name) {
    if (!names(condition, name) || std::find(declared.begin(), declared.end(), name) != declared.end())
      return false;
    declared.push_back(name);
    return true;
  };
  for (const program::Register& r : watched.registers) {
    if (!fresh(r.name)) continue;
    if (r.width == width && r.height == height)
      text += "!register(" + r.name + ")\n";
    else
      text += "!create('" + r.name + "', REGISTER, " + std::to_string(r.width) + ", " +
              std::to_string(r.height) + ")\n";
  }
  for (const program::Variable& v : watched.variables)
    if (fresh(v.name)) text += "!create('" + v.name + "', VARIABLE)\n";
  return text + "#again\n" + debugger::kAnswer + " = " + condition + "\nsurface.step\njump(#again)\n";
}

}  // namespace

std::optional<program::Program> compile_question(const std::string& condition,
                                                 const program::Program& watched, std::uint32_t width,
                                                 std::uint32_t height, std::string& wrong) {
  if (condition.find_first_of("\r\n\\") != std::string::npos || condition.find("//") != std::string::npos) {
    wrong = "a condition is one line, without a comment";
    return std::nullopt;
  }
  syntax::MemoryReader reader;
  reader.files["condition"] = question(condition, watched, width, height);
  compiler::CompileOptions how;
  how.file = "condition";
  how.width = width;
  how.height = height;
  compiler::CompileResult result = compiler::compile(how, reader);
  if (result.program) return std::move(result.program);
  wrong = result.diagnostics.empty() ? "this is no condition" : result.diagnostics.front().message;
  return std::nullopt;
}

}  // namespace apron::run
