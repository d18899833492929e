#include "apron/run/import/KernelImport.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <utility>

#include "apron/run/import/KernelTokens.h"
#include "common/text/Suggestion.h"

namespace apron::run {
namespace {

using Kind = KernelTokenKind;
using Tokens = std::vector<KernelToken>;

// The reason why a line cannot be translated.
struct Untranslatable {
  std::string reason;
};

bool is_type_word(const KernelToken& token) {
  static const std::set<std::string> kWords = {
      "int",     "float",  "double",   "bool",    "char",     "unsigned", "signed",    "long",
      "short",   "const",  "static",   "auto",    "void",     "volatile", "constexpr", "inline",
      "uint8_t", "int8_t", "uint16_t", "int16_t", "uint32_t", "int32_t",  "size_t"};
  return token.kind == Kind::kName && kWords.contains(token.text);
}

bool is_number(const Tokens& tokens) {
  return tokens.size() == 1 ? tokens[0].kind == Kind::kNumber
                            : tokens.size() == 2 && tokens[0].is("-") && tokens[1].kind == Kind::kNumber;
}

std::string plain_text(const Tokens& tokens) {
  std::string text;
  for (const KernelToken& token : tokens) text += token.text;
  return text;
}

bool mentions(const Tokens& tokens, const std::string& name) {
  return std::any_of(tokens.begin(), tokens.end(),
                     [&](const KernelToken& token) { return token.is_name(name); });
}

std::string counts(const std::set<std::size_t>& arities) {
  std::string text;
  for (const std::size_t arity : arities) text += (text.empty() ? "" : " or ") + std::to_string(arity);
  return text;
}

class KernelTranslator {
 public:
  KernelTranslator(const KernelVocabulary& vocabulary, const ImportOptions& options)
      : vocabulary_(vocabulary), options_(options) {}

  ImportedKernels translate(std::string_view text) {
    tokens_ = scan_kernel_source(text);
    const bool is_list = std::none_of(tokens_.begin(), tokens_.end(), [](const KernelToken& token) {
      return token.is("{") || token.is_name("scamp5_kernel_begin");
    });
    if (is_list) {
      in_kernel_ = true;
      translate_list(text);
    } else {
      collect_functions();
      translate_file();
    }
    return finish();
  }

 private:
  using Lines = std::vector<std::string>;

  struct Function {
    std::string name;
    std::vector<std::string> parameters;
    std::size_t body = 0, end = 0;  // positions of its '{' and behind its '}'
  };

  // ---- token access
  const KernelToken& peek(std::size_t offset = 0) const {
    return tokens_[std::min(position_ + offset, tokens_.size() - 1)];
  }
  bool at_end() const { return peek().kind == Kind::kEnd; }
  bool consume(std::string_view symbol) {
    if (!peek().is(symbol)) return false;
    ++position_;
    return true;
  }

  // The position behind the bracket that closes the one there; the end of the text if it is not closed.
  std::size_t behind_bracket(std::size_t open) const {
    int depth = 0;
    for (std::size_t i = open; i < tokens_.size(); ++i) {
      const KernelToken& token = tokens_[i];
      if (token.is("(") || token.is("[") || token.is("{")) ++depth;
      if ((token.is(")") || token.is("]") || token.is("}")) && --depth == 0) return i + 1;
    }
    return tokens_.size() - 1;
  }

  // Behind the next ';' outside brackets, or at a '}' that closes the surrounding block.
  void skip_statement() {
    while (!at_end()) {
      if (peek().is("(") || peek().is("[") || peek().is("{")) {
        const bool is_block = peek().is("{");
        position_ = behind_bracket(position_);
        if (is_block && !peek().is(";") && !peek().is(")") && !peek().is(",")) return;
      } else if (peek().is("}")) {
        return;
      } else if (consume(";")) {
        return;
      } else {
        ++position_;
      }
    }
  }

  Tokens tokens_between(std::size_t first, std::size_t last) const {
    Tokens out;
    for (std::size_t i = first; i < last; ++i)
      if (tokens_[i].kind != Kind::kComment) out.push_back(tokens_[i]);
    return out;
  }

  std::vector<Tokens> parse_arguments() {  // at the '('
    const std::size_t close = behind_bracket(position_);
    std::vector<Tokens> arguments(1);
    int depth = 0;
    for (std::size_t i = position_ + 1; i + 1 < close; ++i) {
      const KernelToken& token = tokens_[i];
      if (token.kind == Kind::kComment) continue;
      if (token.is("(") || token.is("[") || token.is("{")) ++depth;
      if (token.is(")") || token.is("]") || token.is("}")) --depth;
      if (depth == 0 && token.is(",")) {
        arguments.emplace_back();
      } else {
        arguments.back().push_back(token);
      }
    }
    if (arguments.size() == 1 && arguments[0].empty()) arguments.clear();
    position_ = close;
    return arguments;
  }

  void note(std::size_t line, std::string text) { notes_.push_back({line, std::move(text), in_kernel_}); }

  // ---- functions, which become macros
  std::optional<Function> function_at(std::size_t first) const {
    std::size_t i = first;
    while (tokens_[i].kind == Kind::kName || tokens_[i].is("*") || tokens_[i].is("&") || tokens_[i].is("::"))
      ++i;
    if (i == first || i < first + 2 || !tokens_[i].is("(") || tokens_[i - 1].kind != Kind::kName)
      return std::nullopt;
    const std::size_t close = behind_bracket(i);
    std::size_t body = close;
    while (tokens_[body].is_name("const") || tokens_[body].is_name("noexcept") ||
           tokens_[body].kind == Kind::kComment)
      ++body;
    if (!tokens_[body].is("{")) return std::nullopt;
    Function function{tokens_[i - 1].text, {}, body, behind_bracket(body)};
    std::string last;
    bool is_default = false;
    for (std::size_t k = i + 1; k < close; ++k) {
      if (tokens_[k].is(",") || k + 1 == close) {
        if (!last.empty() && last != "void") function.parameters.push_back(last);
        last.clear();
        is_default = false;
      } else if (tokens_[k].is("=")) {
        is_default = true;
      } else if (tokens_[k].kind == Kind::kName && !is_default) {
        last = tokens_[k].text;
      }
    }
    return function;
  }

  // A kernel object: scamp5_kernel name([]{ … });
  std::optional<Function> kernel_object_at(std::size_t i) const {
    if (!tokens_[i].is_name("scamp5_kernel") || i + 4 >= tokens_.size()) return std::nullopt;
    if (tokens_[i + 1].kind != Kind::kName || !(tokens_[i + 2].is("(") || tokens_[i + 2].is("{")))
      return std::nullopt;
    if (!tokens_[i + 3].is("[")) return std::nullopt;
    std::size_t body = behind_bracket(i + 3);
    if (tokens_[body].is("(")) body = behind_bracket(body);
    if (!tokens_[body].is("{")) return std::nullopt;
    return Function{tokens_[i + 1].text, {}, body, behind_bracket(i + 2)};
  }

  bool uses_instructions(const Function& function) const {
    for (std::size_t i = function.body; i + 1 < function.end; ++i) {
      if (tokens_[i].is_name("scamp5_kernel_begin")) return true;
      if (tokens_[i].kind == Kind::kName && tokens_[i + 1].is("(") &&
          (vocabulary_.statements.contains(tokens_[i].text) || vocabulary_.values.contains(tokens_[i].text) ||
           functions_.contains(tokens_[i].text)))
        return true;
    }
    return false;
  }

  void collect_functions() {
    for (bool found = true; found;) {  // until the functions that call functions are found, too
      found = false;
      for (std::size_t i = 0; i + 1 < tokens_.size(); ++i) {
        if (const auto kernel = kernel_object_at(i)) {
          found = functions_[kernel->name].insert(0).second || found;
          i = kernel->end - 1;
          continue;
        }
        if (tokens_[i].kind != Kind::kName) continue;
        const auto function = function_at(i);
        if (!function) continue;
        if (function->name != "main" && uses_instructions(*function))
          found = functions_[function->name].insert(function->parameters.size()).second || found;
        i = function->end - 1;
      }
    }
  }

  void translate_function(const Function& function, bool is_kernel) {
    const auto known = functions_.find(function.name);
    const bool is_main = function.name == "main";
    const std::size_t line = tokens_[function.body].line;
    if (!is_main && known == functions_.end()) {
      note(line, fmt::format("the function '{}' has no instruction of the chip", function.name));
      position_ = function.end;
      return;
    }
    has_main_ = has_main_ || is_main;
    const bool exists = vocabulary_.statements.contains(function.name) &&
                        vocabulary_.statements.at(function.name).contains(function.parameters.size());
    if (exists) {
      note(line, fmt::format("scamp5.aps has an instruction '{}' of {} arguments, which is used instead",
                             function.name, function.parameters.size()));
      position_ = function.end;
      return;
    }
    Lines body;
    position_ = function.body;
    parameters_ = {function.parameters.begin(), function.parameters.end()};
    in_kernel_ = is_kernel;
    in_macro_ = !is_main;
    translate_statement(is_main ? main_ : body, 0);
    in_kernel_ = in_macro_ = false;
    parameters_.clear();
    position_ = function.end;
    if (is_main) return;
    uncalled_.push_back({function.name, function.parameters.size()});
    add_macro(function.name, function.parameters, body, line);
  }

  void add_macro(const std::string& name, const std::vector<std::string>& parameters, const Lines& body,
                 std::size_t line) {
    macros_.push_back(fmt::format("// {}, line {}", name, line));
    macros_.emplace_back("!macro_def");
    std::string pattern = name;
    for (std::size_t i = 0; i < parameters.size(); ++i) pattern += (i == 0 ? "($" : ", $") + parameters[i];
    macros_.push_back(pattern + (parameters.empty() ? "" : ")"));
    macros_.emplace_back("!macro_begin");
    macros_.insert(macros_.end(), body.begin(), body.end());
    if (body.empty()) macros_.emplace_back("nop");
    macros_.emplace_back("!macro_end");
    macros_.emplace_back("");
  }

  // ---- the file
  void translate_file() {
    while (!at_end()) {
      if (peek().kind == Kind::kDirective) {
        translate_directive();
      } else if (peek().kind == Kind::kComment || peek().is(";") || peek().is("}")) {
        ++position_;
      } else if (peek().is_name("using") || peek().is_name("typedef") || peek().is_name("template")) {
        skip_statement();
      } else if (peek().is_name("namespace") || peek().is_name("extern")) {
        while (!at_end() && !peek().is("{") && !peek().is(";")) ++position_;
        ++position_;
      } else if (peek().is_name("class") || peek().is_name("struct") || peek().is_name("enum")) {
        note(peek().line, fmt::format("the {} '{}' is left out", peek().text, peek(1).text));
        skip_statement();
      } else if (const auto kernel = kernel_object_at(position_)) {
        translate_function(*kernel, true);
        consume(";");
      } else if (const auto function = function_at(position_)) {
        translate_function(*function, false);
      } else {
        translate_statement(main_, 0);
      }
    }
  }

  // A macro of the preprocessor: an object-like one becomes a define, a function-like one a macro.
  void translate_directive() {
    const KernelToken directive = tokens_[position_++];
    if (!directive.text.starts_with("define ")) return;
    const std::string definition = directive.text.substr(7);
    const Tokens words = scan_kernel_source(definition, directive.line);
    if (words.size() < 2 || words[0].kind != Kind::kName) return;
    const std::string& name = words[0].text;
    if (!definition.substr(definition.find(name) + name.size()).starts_with('(')) {
      Tokens value(words.begin() + 1, words.end() - 1);
      if (value.empty()) return;
      try {
        defines_.push_back(fmt::format("!define({}, {})", name, expression(value)));
        known_names_.insert(name);
      } catch (const Untranslatable& error) {
        note(directive.line, fmt::format("#define {}: {}", name, error.reason));
      }
      return;
    }
    const bool has_instructions = std::any_of(words.begin(), words.end(), [&](const KernelToken& word) {
      return word.kind == Kind::kName && word.text != name &&
             (vocabulary_.statements.contains(word.text) || functions_.contains(word.text));
    });
    if (!has_instructions)
      return note(directive.line, fmt::format("the macro '{}' has no instruction of the chip", name));
    Tokens saved_tokens = std::exchange(tokens_, words);
    const std::size_t saved_position = std::exchange(position_, 1);
    std::vector<std::string> parameters;
    for (const Tokens& parameter : parse_arguments()) parameters.push_back(plain_text(parameter));
    const auto existing = vocabulary_.statements.find(name);
    const bool is_known =
        existing != vocabulary_.statements.end() && existing->second.contains(parameters.size());
    if (!is_known) {
      Lines body;
      parameters_ = {parameters.begin(), parameters.end()};
      in_kernel_ = in_macro_ = true;
      consume("(");  // of ({ … })
      while (!at_end()) {
        if (peek().is(")")) ++position_;
        if (!at_end()) translate_statement(body, 0);
      }
      in_kernel_ = in_macro_ = false;
      parameters_.clear();
      functions_[name].insert(parameters.size());
      add_macro(name, parameters, body, directive.line);
    }
    tokens_ = std::move(saved_tokens);
    position_ = saved_position;
  }

  // ---- statements
  static void emit(Lines& out, int depth, const std::string& text) {
    out.push_back(std::string(static_cast<std::size_t>(depth) * 2, ' ') + text);
  }

  void translate_statement(Lines& out, int depth) {
    const std::size_t line = peek().line;
    const std::size_t start = position_;
    try {
      dispatch_statement(out, depth);
    } catch (const Untranslatable& error) {
      const bool is_block = tokens_[start].is_name("for") || tokens_[start].is_name("while") ||
                            tokens_[start].is_name("if") || tokens_[start].is_name("switch") ||
                            tokens_[start].is_name("do");
      note(line, error.reason);
      if (in_kernel_ || is_block)
        emit(out, depth, fmt::format("// not translated (line {}): {}", line, error.reason));
      position_ = start;
      if (is_block) position_ = behind_bracket(position_ + (tokens_[start].is_name("do") ? 0 : 1));
      skip_statement();
      if (position_ == start) ++position_;
    }
  }

  void dispatch_statement(Lines& out, int depth) {
    const KernelToken& first = peek();
    if (first.kind == Kind::kComment) {
      if (!first.text.empty() && first.text.find_first_not_of("-/=*") != std::string::npos)
        emit(out, depth, "// " + first.text);
      ++position_;
      return;
    }
    if (first.kind == Kind::kDirective) return translate_directive();
    if (consume(";")) return;
    if (consume("{")) {
      while (!at_end() && !peek().is("}")) translate_statement(out, depth);
      ++position_;
      return;
    }
    if (first.is_name("for")) return translate_for(out, depth);
    if (first.is_name("while")) return translate_while(out, depth);
    if (first.is_name("if")) return translate_if(out, depth);
    if (first.is_name("do") || first.is_name("switch") || first.is_name("case"))
      throw Untranslatable{fmt::format("'{}' has no counterpart", first.text)};
    if ((first.is_name("break") || first.is_name("continue")) && peek(1).is(";")) {
      emit(out, depth, first.text);
      position_ += 2;
      return;
    }
    if (first.is_name("return")) {
      skip_statement();
      return;
    }
    if (first.is_name("using")) return skip_statement();
    if (is_type_word(first)) return translate_declaration(out, depth);
    if (first.kind != Kind::kName) throw Untranslatable{fmt::format("'{}' begins no statement", first.text)};
    while (peek(1).is("::")) position_ += 2;
    if (peek(1).is("(")) return translate_call(out, depth);
    translate_assignment(out, depth);
  }

  std::size_t statement_end(std::size_t first) const {
    std::size_t i = first;
    while (i + 1 < tokens_.size() && !tokens_[i].is(";") && !tokens_[i].is("}"))
      i = tokens_[i].is("(") || tokens_[i].is("[") || tokens_[i].is("{") ? behind_bracket(i) : i + 1;
    return i;
  }

  void translate_declaration(Lines& out, int depth) {
    while (is_type_word(peek()) || peek().is("*") || peek().is("&")) ++position_;
    if (peek().kind != Kind::kName) throw Untranslatable{"a declaration without a name"};
    if (peek(1).is("(")) return skip_statement();  // a prototype
    if (peek(1).is(";")) {
      known_names_.insert(peek().text);
      emit(out, depth, fmt::format("{} = 0", peek().text));
      position_ += 2;
      return;
    }
    translate_assignment(out, depth);
  }

  void translate_assignment(Lines& out, int depth) {
    const std::string name = peek().text;
    const KernelToken op = peek(1);
    const std::size_t end = statement_end(position_);
    const std::string target = parameters_.contains(name) ? "$" + name : name;
    if ((op.is("++") || op.is("--")) && position_ + 2 == end) {
      emit(out, depth, fmt::format("{0} = {0} {1} 1", target, op.text.substr(1)));
    } else if (op.is("=") || op.is("+=") || op.is("-=") || op.is("*=")) {
      const std::string value = expression(tokens_between(position_ + 2, end));
      const bool is_compound = op.text.size() == 2;
      emit(out, depth,
           is_compound ? fmt::format("{0} = {0} {1} ({2})", target, op.text.substr(0, 1), value)
                       : fmt::format("{} = {}", target, value));
    } else {
      throw Untranslatable{fmt::format("'{} {} …' is code of the controller", name, op.text)};
    }
    known_names_.insert(name);
    position_ = end;
    consume(";");
  }

  void translate_body(Lines& out, int depth) {
    translate_statement(out, depth + 1);
    while (peek().kind == Kind::kComment && peek(1).is_name("else")) ++position_;
  }

  void translate_for(Lines& out, int depth) {
    const std::size_t close = behind_bracket(position_ + 1);
    std::vector<Tokens> parts(1);
    for (const KernelToken& token : tokens_between(position_ + 2, close - 1)) {
      if (token.is(";")) {
        parts.emplace_back();
      } else if (!is_type_word(token)) {
        parts.back().push_back(token);
      }
    }
    if (parts.size() != 3) throw Untranslatable{"this 'for' is not for(i = a; i < b; i++)"};
    if (parts[0].empty() && parts[1].empty() && parts[2].empty()) {
      position_ = close;
      return translate_frames(out, depth);
    }
    const Tokens& init = parts[0];
    const Tokens& test = parts[1];
    const Tokens& step = parts[2];
    const bool valid = init.size() >= 3 && init[0].kind == Kind::kName && init[1].is("=") &&
                       test.size() >= 3 && test[0].is_name(init[0].text) && step.size() >= 2 &&
                       mentions(step, init[0].text);
    const std::string& variable = valid ? init[0].text : "";
    std::string stride;
    if (valid && step.size() == 2) stride = plain_text(step).find("++") != std::string::npos ? "1" : "-1";
    if (valid && step.size() >= 3 && step[1].is("+=")) stride = expression({step.begin() + 2, step.end()});
    if (valid && step.size() >= 3 && step[1].is("-="))
      stride = "-" + expression({step.begin() + 2, step.end()});
    const bool upward = !stride.empty() && stride[0] != '-';
    const KernelToken op = valid ? test[1] : KernelToken{};
    const bool fits = upward ? op.is("<") || op.is("<=") || op.is("!=") : op.is(">") || op.is(">=");
    if (!valid || stride.empty() || !fits) throw Untranslatable{"this 'for' is not for(i = a; i < b; i++)"};
    const Tokens from(init.begin() + 2, init.end());
    const Tokens to(test.begin() + 2, test.end());
    const std::string first = expression(from);
    std::string last = expression(to);
    const bool exclusive = op.is("<") || op.is(">") || op.is("!=");
    if (exclusive && is_number(to)) {
      last = std::to_string(std::strtol(last.c_str(), nullptr, 0) + (upward ? -1 : 1));
    } else if (exclusive) {
      last += upward ? " - 1" : " + 1";
    }
    position_ = close;
    known_names_.insert(variable);
    const std::size_t body_end = peek().is("{") ? behind_bracket(position_) : statement_end(position_);
    const bool is_plain =
        stride == "1" && first == "0" && !mentions(tokens_between(position_, body_end), variable);
    if (is_plain) {
      emit(out, depth, fmt::format("repeat({})", expression(to) + (exclusive ? "" : " + 1")));
    } else {
      emit(out, depth,
           stride == "1" ? fmt::format("for({}, {}, {})", variable, first, last)
                         : fmt::format("for({}, {}, {}, {})", variable, first, last, stride));
    }
    translate_body(out, depth);
    emit(out, depth, is_plain ? "endrepeat" : "endfor");
  }

  // The loop over the frames, which has no end on the chip.
  void translate_frames(Lines& out, int depth) {
    uses_frames_ = true;
    emit(out, depth, "repeat(FRAMES)");
    if (!options_.picture.empty())
      emit(out, depth + 1, fmt::format("PIX = io.image.open('{}')", options_.picture));
    translate_body(out, depth);
    emit(out, depth, "endrepeat");
  }

  void translate_while(Lines& out, int depth) {
    ++position_;
    const std::size_t open = position_;
    const std::size_t close = behind_bracket(open);
    const Tokens condition = tokens_between(open + 1, close - 1);
    const bool endless = condition.size() == 1 && (condition[0].is_name("true") || condition[0].text == "1");
    if (endless) {
      position_ = close;
      return translate_frames(out, depth);
    }
    const std::string text = expression(condition);
    position_ = close;
    emit(out, depth, fmt::format("while({})", text));
    translate_body(out, depth);
    emit(out, depth, "endwhile");
  }

  void translate_if(Lines& out, int depth) {
    ++position_;
    const std::size_t open = position_;
    const std::size_t close = behind_bracket(open);
    const std::string text = expression(tokens_between(open + 1, close - 1));
    position_ = close;
    emit(out, depth, fmt::format("if({})", text));
    translate_body(out, depth);
    if (peek().is_name("else")) {
      ++position_;
      emit(out, depth, "else");
      translate_body(out, depth);
    }
    emit(out, depth, "endif");
  }

  // ---- calls
  void translate_call(Lines& out, int depth) {
    const std::string name = peek().text;
    const std::size_t line = peek().line;
    ++position_;
    const std::vector<Tokens> arguments = parse_arguments();
    if (peek().kind == Kind::kPunctuator && !peek().is(";") && !peek().is("}") && !peek().is(")"))
      throw Untranslatable{fmt::format("the expression that begins with '{}(…)' has no counterpart", name)};
    consume(";");
    if (name == "scamp5_kernel_begin" || name == "scamp5_kernel_end") {
      in_kernel_ = name == "scamp5_kernel_begin";
      return;
    }
    if (name == "scamp5_launch_kernel" && arguments.size() == 1) {
      called_.insert(plain_text(arguments[0]));
      return emit(out, depth, plain_text(arguments[0]));
    }
    if (name.starts_with("vs_gui_add_s") && translate_control(name, arguments)) return;
    if (name == "scamp5_output_image" && !arguments.empty())
      return emit(out, depth, fmt::format("sim.show({})", expression(arguments[0])));
    if (name == "DNEWS" && arguments.size() >= 3 && arguments[2].size() > 1)
      return translate_directions(out, depth, arguments);
    emit(out, depth, call_text(name, arguments, line, false));
  }

  // A slider or switch of the host's window.
  bool translate_control(const std::string& name, const std::vector<Tokens>& arguments) {
    const bool is_slider = name == "vs_gui_add_slider";
    const std::size_t count = is_slider ? 5 : 3;
    if (arguments.size() != count || arguments.back().size() != 2 || !arguments.back()[0].is("&"))
      return false;
    const std::string& variable = arguments.back()[1].text;
    std::string values;
    for (std::size_t i = 1; i + 1 < count; ++i) {
      if (is_slider && !is_number(arguments[i]) && !known_names_.contains(plain_text(arguments[i])))
        return false;
      values += ", " + (is_number(arguments[i]) ? plain_text(arguments[i])
                        : is_slider             ? plain_text(arguments[i])
                                                : "0");
    }
    controls_.push_back(fmt::format("sim.{}.add('{}'{})", is_slider ? "slider" : "switch", variable, values));
    main_.push_back(fmt::format("{0} = sim.{1}.get('{0}')", variable, is_slider ? "slider" : "switch"));
    known_names_.insert(variable);
    return true;
  }

  // DNEWS with several directions: RS, RW, RN and RE in every cell, then the OR of the neighbours.
  void translate_directions(Lines& out, int depth, const std::vector<Tokens>& arguments) {
    static const std::map<std::string, std::string> kSelectors = {
        {"south", "RS"}, {"west", "RW"}, {"north", "RN"}, {"east", "RE"}};
    std::string selected;
    for (const KernelToken& token : arguments[2]) {
      if (token.is("|")) continue;
      const auto selector = kSelectors.find(token.text);
      if (selector == kSelectors.end())
        throw Untranslatable{fmt::format("'{}' is no direction", plain_text(arguments[2]))};
      selected += (selected.empty() ? "" : ", ") + selector->second;
    }
    const bool edge =
        arguments.size() > 3 && plain_text(arguments[3]) != "0" && plain_text(arguments[3]) != "false";
    emit(out, depth, "CLR(RS, RW, RN, RE)");
    emit(out, depth, fmt::format("SET({})", selected));
    emit(out, depth,
         fmt::format("DNEWS{}({}, {})", edge ? 1 : 0, expression(arguments[0]), expression(arguments[1])));
    instructions_ += 3;
  }

  std::string call_text(const std::string& name, const std::vector<Tokens>& arguments, std::size_t line,
                        bool value) {
    const auto& table = value ? vocabulary_.values : vocabulary_.statements;
    const auto found = table.find(name);
    const auto function = functions_.find(name);
    const bool is_function =
        !value && function != functions_.end() && function->second.contains(arguments.size());
    if (found == table.end() && !is_function) {
      std::vector<std::string> known;
      for (const auto& [mnemonic, arities] : table) known.push_back(mnemonic);
      if (in_kernel_)
        throw Untranslatable{
            fmt::format("scamp5.aps has no instruction '{}'{}", name, common::did_you_mean(name, known))};
      throw Untranslatable{fmt::format("'{}' runs on the controller or host", name)};
    }
    if (!is_function && !found->second.contains(arguments.size()))
      throw Untranslatable{
          fmt::format("'{}' takes {} arguments, not {}", name, counts(found->second), arguments.size())};
    std::string text;
    for (const Tokens& argument : arguments) text += (text.empty() ? "(" : ", ") + expression(argument, line);
    if (is_function) called_.insert(name);
    if (!is_function) ++instructions_;
    return name + text + (arguments.empty() ? "" : ")");
  }

  // ---- expressions
  std::string expression(const Tokens& tokens, std::size_t line = 0) {
    std::string text;
    bool after_value = false;
    for (std::size_t i = 0; i < tokens.size(); ++i) {
      const KernelToken& token = tokens[i];
      if (token.kind == Kind::kName && i + 1 < tokens.size() && tokens[i + 1].is("::")) {
        ++i;
        continue;
      }
      if (token.kind == Kind::kName && i + 1 < tokens.size() && tokens[i + 1].is("(")) {
        text += nested_call(tokens, i);
        after_value = true;
        continue;
      }
      if (token.kind == Kind::kNumber || token.kind == Kind::kName) {
        text += token.kind == Kind::kName ? operand(token, line) : token.text;
        after_value = true;
        continue;
      }
      static const std::set<std::string> kInfix = {"+",  "-",  "*",  "/",  "%",  "<", ">",
                                                   "<=", ">=", "==", "!=", "&&", "||"};
      const bool bracket = token.is("(") || token.is(")");
      if (token.kind != Kind::kPunctuator || (!bracket && !token.is("!") && !kInfix.contains(token.text)))
        throw Untranslatable{fmt::format("'{}' in an expression has no counterpart", token.text)};
      const bool infix = kInfix.contains(token.text) && after_value;
      text += infix ? " " + token.text + " " : token.text;
      after_value = token.is(")");
    }
    if (text.empty()) throw Untranslatable{"a value is missing"};
    return text;
  }

  std::string nested_call(const Tokens& tokens, std::size_t& i) {
    const std::string name = tokens[i].text;
    std::vector<Tokens> arguments(1);
    int depth = 0;
    std::size_t end = i + 1;
    for (; end < tokens.size(); ++end) {
      const KernelToken& token = tokens[end];
      if (token.is(")") && --depth == 0) break;
      if (depth == 1 && token.is(",")) {
        arguments.emplace_back();
      } else if (depth > 0) {
        arguments.back().push_back(token);
      }
      if (token.is("(")) ++depth;
    }
    if (arguments.size() == 1 && arguments[0].empty()) arguments.clear();
    const std::size_t line = tokens[i].line;
    i = end;
    return call_text(name, arguments, line, true);
  }

  std::string operand(const KernelToken& token, std::size_t line) {
    if (token.text == "true") return "1";
    if (token.text == "false") return "0";
    if (parameters_.contains(token.text)) return "$" + token.text;
    const bool is_known = vocabulary_.names.contains(token.text) || known_names_.contains(token.text);
    if (!is_known && unset_.insert(token.text).second) {
      note(line == 0 ? token.line : line,
           fmt::format("'{}' has no value in the kernels; it is 0", token.text));
      unset_lines_.push_back(fmt::format("{} = 0  // of the program around the kernels", token.text));
    }
    return token.text;
  }

  // ---- lists of instructions, one a line: y = op(a, b) or op(y, a, b)
  void translate_list(std::string_view text) {
    std::size_t line = 1;
    while (!text.empty()) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      std::string_view row = text.substr(0, end);
      text.remove_prefix(std::min(end + 1, text.size()));
      const std::size_t first = row.find_first_not_of(" \t\r");
      const bool is_comment = first != std::string_view::npos &&
                              (row[first] == '#' || row[first] == '%' || row.substr(first).starts_with("//"));
      if (is_comment) {
        const std::size_t from = row.find_first_not_of("#%/ \t", first);
        if (from != std::string_view::npos)
          main_.push_back("// " + std::string(row.substr(from, row.find('\r') - from)));
      } else if (first != std::string_view::npos) {
        tokens_ = scan_kernel_source(row, line);
        position_ = 0;
        translate_row();
      }
      ++line;
    }
  }

  void translate_row() {
    const std::size_t line = peek().line;
    try {
      if (peek().kind == Kind::kName && peek(1).is("=") && peek(2).kind == Kind::kName && peek(3).is("(")) {
        const std::string target = operand(peek(), line);
        const std::string name = peek(2).text;
        position_ += 3;
        std::vector<Tokens> arguments = parse_arguments();
        arguments.insert(arguments.begin(), Tokens{KernelToken{Kind::kName, target, line}});
        main_.push_back(call_text(name, arguments, line, false));
      } else {
        while (!at_end()) dispatch_statement(main_, 0);
      }
    } catch (const Untranslatable& error) {
      note(line, error.reason);
      main_.push_back(fmt::format("// not translated (line {}): {}", line, error.reason));
    }
  }

  // ---- the program
  ImportedKernels finish() {
    std::string text =
        fmt::format("// Imported from {} by apron import.\n!include('scamp5.aps')\n", options_.source_name);
    if (uses_frames_) text += "!define(FRAMES, 1)\n";
    const auto append = [&](const Lines& lines) {
      for (const std::string& line : lines) text += line + '\n';
    };
    append(defines_);
    append(controls_);
    append(unset_lines_);
    text += '\n';
    append(macros_);
    if (!options_.picture.empty() && !uses_frames_)
      text += fmt::format("PIX = io.image.open('{}')\n", options_.picture);
    append(main_);
    if (!has_main_) {  // the kernels in the order of the text
      for (const auto& [name, arity] : uncalled_)
        if (arity == 0 && !called_.contains(name)) text += name + '\n';
    }
    return {std::move(text), std::move(notes_), instructions_};
  }

  const KernelVocabulary& vocabulary_;
  const ImportOptions& options_;
  Tokens tokens_;
  std::size_t position_ = 0;
  std::map<std::string, std::set<std::size_t>>
      functions_;                     // that become macros, with their numbers of parameters
  std::set<std::string> parameters_;  // of the current function
  std::set<std::string> known_names_, unset_, called_;
  std::vector<std::pair<std::string, std::size_t>> uncalled_;
  Lines defines_, controls_, unset_lines_, macros_, main_;
  std::vector<ImportNote> notes_;
  std::size_t instructions_ = 0;
  bool in_kernel_ = false, in_macro_ = false, uses_frames_ = false, has_main_ = false;
};

}  // namespace

// Reads the patterns of the macros and the declarations, line by line.
KernelVocabulary read_vocabulary(std::string_view library) {
  KernelVocabulary vocabulary;
  vocabulary.names = {"north", "east", "south", "west", "alldir"};
  bool is_pattern = false;
  while (!library.empty()) {
    const std::size_t end = std::min(library.find('\n'), library.size());
    std::string line(library.substr(0, end));
    library.remove_prefix(std::min(end + 1, library.size()));
    const std::size_t open = line.find('(');
    if (is_pattern) {
      const bool has_result = line.starts_with('$');
      if (has_result) line.erase(0, line.find('=') + 2);
      const std::string name = line.substr(0, line.find('('));
      const std::size_t arity = static_cast<std::size_t>(std::count(line.begin(), line.end(), '$'));
      (has_result ? vocabulary.values : vocabulary.statements)[name].insert(arity);
    } else if (open != std::string::npos &&
               (line.starts_with("!register(") || line.starts_with("!machine_register("))) {
      std::string name;
      for (const char c : line.substr(open + 1)) {
        if (c != ',' && c != ')' && c != ' ') name += c;
        if (c == ',' || c == ')') vocabulary.names.insert(std::exchange(name, {}));
      }
    } else if (line.starts_with("!define(")) {
      vocabulary.names.insert(line.substr(8, line.find(',') - 8));
    }
    is_pattern = line.starts_with("!macro_def");
  }
  return vocabulary;
}

ImportedKernels import_kernels(std::string_view text, const KernelVocabulary& vocabulary,
                               const ImportOptions& options) {
  return KernelTranslator(vocabulary, options).translate(text);
}

}  // namespace apron::run
