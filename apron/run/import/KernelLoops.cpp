// Loops and other control flow of kernels.
#include <fmt/format.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "apron/run/import/KernelSourceReader.h"

namespace apron::run {

using Kind = KernelTokenKind;

namespace {

// The parts of a for's header, between its semicolons.
std::vector<KernelTokenList> split_header(const KernelTokenList& header) {
  std::vector<KernelTokenList> parts(1);
  for (const KernelToken& token : header) {
    if (token.is(";"))
      parts.emplace_back();
    else
      parts.back().push_back(token);
  }
  return parts;
}

}  // namespace

std::string KernelSourceReader::label(const std::string& stem) {
  return fmt::format("{}#{}{}", in_macro_ ? ":" : "", stem, ++labels_);
}

KernelSourceReader::Loop KernelSourceReader::loop_body(ProgramLines& out, int depth,
                                                       std::string continue_label, bool is_endless) {
  const ValueFlow::Node node = flow_.add();
  flow_.write(node);
  loops_.push_back({std::move(continue_label), false, node, {}, {}});
  {
    const ValueFlow::Guard guard(flow_, node);
    translate_body(out, depth);
  }
  Loop loop = std::move(loops_.back());
  loops_.pop_back();
  if (loop.is_used) emit(out, depth + 1, loop.continue_label);
  if (!is_endless && !loop.left_out_break.empty()) flow_.leave_out(node, loop.left_out_break);
  return loop;
}

bool KernelSourceReader::may_change(const std::string& name, std::size_t first, std::size_t last) const {
  std::set<std::size_t> visited;
  return may_change(name, first, last, visited);
}

bool KernelSourceReader::may_change(const std::string& name, std::size_t first, std::size_t last,
                                    std::set<std::size_t>& visited) const {
  for (std::size_t i = first; i < last && i + 1 < tokens_.size(); ++i) {
    if (tokens_[i].is_name(name)) {
      const KernelToken& next = tokens_[i + 1];
      if (is_assignment(next) || next.is("++") || next.is("--")) return true;
      if (i > 0 && (tokens_[i - 1].is("++") || tokens_[i - 1].is("--") || tokens_[i - 1].is("&")))
        return true;
      // A variable of which a reference may change it.
      if (i > 2 && tokens_[i - 1].is("=") && tokens_[i - 3].is("&")) return true;
      // An argument that a function may take by reference.
      const bool is_argument =
          i > 0 && (tokens_[i - 1].is("(") || tokens_[i - 1].is(",")) && (next.is(")") || next.is(","));
      if (is_argument && has_references_) return true;
    }
    if (tokens_[i].kind != Kind::kName || !tokens_[i + 1].is("(")) continue;
    for (const Function& function : functions_of(tokens_[i].text)) {
      if (!visited.insert(function.body).second) continue;
      if (function.body <= first && first < function.end) continue;
      if (may_change(name, function.body, function.end, visited)) return true;
    }
  }
  return false;
}

bool KernelSourceReader::may_change_any(const KernelTokenList& names, std::size_t first,
                                        std::size_t last) const {
  return std::ranges::any_of(names, [&](const KernelToken& token) {
    return token.kind == Kind::kName && may_change(token.text, first, last);
  });
}

// An endless loop that leaves itself and takes no frame.
bool KernelSourceReader::leaves_itself(std::size_t body) const {
  if (body >= staying_.first && body < staying_.second) return false;
  const auto end_of = [this](std::size_t first) {
    return tokens_[first].is("{") ? behind_bracket(first) : statement_end(first);
  };
  const std::size_t end = end_of(body);
  bool leaves = false, any_leaves = false;
  std::size_t inner_end = body;  // of the loop within this one
  for (std::size_t i = body; i < end && i + 1 < tokens_.size(); ++i) {
    const KernelToken& token = tokens_[i];
    if (token.kind != Kind::kName) continue;
    if (takes_frame(i)) return false;
    if (i >= inner_end && token.is_name_of({"for", "while", "switch"}))
      inner_end = end_of(behind_bracket(i + 1));
    else if (i >= inner_end && token.is_name("do"))
      inner_end = end_of(i + 1);
    if (!token.is_name_of({"return", "break"})) continue;
    any_leaves = true;
    leaves = leaves || token.is_name("return") || i >= inner_end;
  }
  if (!any_leaves) staying_ = {body, end};
  return leaves;
}

// True of what waits for a frame or for the host, and of a function that does.
bool KernelSourceReader::takes_frame(std::size_t word) const {
  std::set<std::size_t> visited;
  return takes_frame(word, visited);
}

bool KernelSourceReader::takes_frame(std::size_t word, std::set<std::size_t>& visited) const {
  const std::string& name = tokens_[word].text;
  if (name.starts_with("vs_") || name.find("get_image") != std::string::npos || name == "getpix" ||
      name == "rpix" || name == "respix")
    return true;
  return tokens_[word + 1].is("(") && std::ranges::any_of(functions_of(name), [&](const Function& function) {
           if (!visited.insert(function.body).second) return false;
           for (std::size_t i = function.body; i < function.end && i + 1 < tokens_.size(); ++i)
             if (tokens_[i].kind == Kind::kName && takes_frame(i, visited)) return true;
           return false;
         });
}

void KernelSourceReader::translate_for(ProgramLines& out, int depth) {
  const std::size_t close = behind_bracket(position_ + 1);
  const bool is_endless = close == position_ + 5 && peek(2).is(";") && peek(3).is(";");
  if (is_endless) {
    position_ = close;
    return translate_frames(out, depth);
  }
  const std::size_t open = position_ + 2;
  const KernelTokenList header = tokens_between(open, close - 1);
  const std::size_t body_end = tokens_[close].is("{") ? behind_bracket(close) : statement_end(close);
  const auto loop = counted_loop(header, close, body_end);
  position_ = close;
  if (!loop) return translate_other_for(header, open, out, depth);
  scopes_.emplace_back();
  const bool is_plain =
      !loop->repetitions.empty() && !mentions(tokens_between(close, body_end), loop->variable);
  if (is_plain) {
    emit(out, depth, fmt::format("repeat({})", loop->repetitions));
  } else {
    Variable& variable = declare(loop->variable, loop->type);
    variable.range = loop->range;
    const std::string stride = loop->stride == "1" ? "" : ", " + loop->stride;
    emit(out, depth, fmt::format("for({}, {}, {}{})", variable.text, loop->first, loop->last, stride));
  }
  loop_body(out, depth, "");
  emit(out, depth, is_plain ? "endrepeat" : "endfor");
  scopes_.pop_back();
}

std::optional<KernelSourceReader::CountedLoop> KernelSourceReader::counted_loop(const KernelTokenList& header,
                                                                                std::size_t body,
                                                                                std::size_t body_end) {
  std::vector<KernelTokenList> parts = split_header(header);
  if (parts.size() != 3) return std::nullopt;
  const auto& [init, test, step] = std::tie(parts[0], parts[1], parts[2]);
  CountedLoop loop;
  std::size_t at = 0;
  // A variable that is declared outside keeps its last value after the loop.
  const auto type = read_type(init, at);
  if (!type || !is_integer(*type) || *type == CppType::kBool || init.size() < at + 3 || !init[at + 1].is("="))
    return std::nullopt;
  loop.type = *type;
  loop.variable = init[at].text;
  if (test.size() < 3 || !test[0].is_name(loop.variable) || step.size() < 2 || !mentions(step, loop.variable))
    return std::nullopt;
  const KernelTokenList bound(test.begin() + 2, test.end()), first(init.begin() + at + 2, init.end());
  if (mentions(bound, loop.variable) || mentions(first, ",")) return std::nullopt;
  for (const KernelToken& token : init)
    if (token.is(",")) return std::nullopt;
  double stride = 0;
  if (step.size() == 2) {
    const std::string op = step[0].kind == Kind::kPunctuator ? step[0].text : step[1].text;
    stride = op == "++" ? 1 : op == "--" ? -1 : 0;
  } else if ((step[1].is("+=") || step[1].is("-=")) && step[0].is_name(loop.variable)) {
    const auto value = plain_expression({step.begin() + 2, step.end()});
    if (value && value->constant && value->type != CppType::kFloat)
      stride = step[1].is("+=") ? *value->constant : -*value->constant;
  }
  const KernelToken& op = test[1];
  const bool upward = stride > 0;
  const bool fits =
      upward ? op.is("<") || op.is("<=") || op.is("!=") : op.is(">") || op.is(">=") || op.is("!=");
  if (stride == 0 || !fits || may_change(loop.variable, body, body_end) ||
      may_change_any(bound, body, body_end))
    return std::nullopt;
  const auto begin = plain_expression(first), end = plain_expression(bound);
  if (!begin || !end || !is_integer(begin->type) || !is_integer(end->type)) return std::nullopt;
  if (begin->type == CppType::kUint || end->type == CppType::kUint) return std::nullopt;
  const CppRange limits = range_of(loop.type);
  const bool is_exclusive = op.is("<") || op.is(">") || op.is("!=");
  if (op.is("!=") && (!begin->constant || !end->constant || (stride != 1 && stride != -1) ||
                      (*end->constant - *begin->constant) * stride < 0))
    return std::nullopt;
  // A counter that wraps never ends.
  if (!begin->range.within(limits)) return std::nullopt;
  if (upward ? end->range.high + stride - (is_exclusive ? 1 : 0) > limits.high && loop.type != CppType::kInt
             : end->range.low + stride + (is_exclusive ? 1 : 0) < limits.low && loop.type != CppType::kInt)
    return std::nullopt;
  loop.stride = fmt::format("{:.0f}", stride);
  loop.first = begin->text;
  const auto last =
      is_exclusive ? *cpp_binary(*end, upward ? "-" : "+", cpp_constant(1, CppType::kInt)) : *end;
  loop.last = last.text;
  loop.range = upward ? CppRange{begin->range.low, std::max(begin->range.low, last.range.high)}
                      : CppRange{std::min(begin->range.high, last.range.low), begin->range.high};
  if (stride == 1 && begin->constant && *begin->constant == 0)
    loop.repetitions = is_exclusive ? end->text : cpp_binary(*end, "+", cpp_constant(1, CppType::kInt))->text;
  return loop;
}

// Any other loop: while, with the step at its end.
void KernelSourceReader::translate_other_for(const KernelTokenList& header, std::size_t open,
                                             ProgramLines& out, int depth) {
  std::vector<KernelTokenList> parts = split_header(header);
  if (parts.size() != 3) give_up("this 'for' is not for(i = a; i < b; i++)");
  scopes_.emplace_back();
  const std::size_t body = position_;
  if (!parts[0].empty()) {
    position_ = open;
    dispatch_statement(out, depth);
    position_ = body;
  }
  emit(out, depth, "while(1)");
  if (!parts[1].empty()) emit_leave_unless(parts[1], out, depth + 1);
  loop_body(out, depth, label("continue"));
  if (!parts[2].empty()) {
    const auto steps = split_arguments(parts[2], 0, parts[2].size());
    for (const KernelTokenList& one : steps) expression(one, out, depth + 1);
  }
  emit(out, depth, "endwhile");
  scopes_.pop_back();
}

void KernelSourceReader::emit_leave_unless(const KernelTokenList& condition, ProgramLines& out, int depth) {
  const CppValue value = cpp_not(settle(expression(condition, out, depth), out, depth));
  if (!is_scalar(value.type)) give_up("'{}' is no condition", plain_text(condition));
  if (value.constant && *value.constant == 0.0) return;
  emit(out, depth, fmt::format("if({})", value.text));
  emit(out, depth + 1, "break");
  emit(out, depth, "endif");
}

void KernelSourceReader::translate_frames(ProgramLines& out, int depth) {
  if (leaves_itself(position_)) {
    ProgramLines body;
    const Loop loop = loop_body(body, depth, "", true);
    // The statement that leaves the loop may have been left out.
    const bool leaves = std::ranges::any_of(body, [](const std::string& line) {
      const std::string text = line.substr(std::min(line.find_first_not_of(' '), line.size()));
      return text == "break" || text == "end" || text == "jump(:#return)";
    });
    if (!leaves) uses_frames_ = true;
    if (leaves && !loop.left_out_break.empty()) flow_.leave_out(loop.node, loop.left_out_break);
    emit(out, depth, leaves ? "while(1)" : "repeat(FRAMES)");
    out.insert(out.end(), body.begin(), body.end());
    return emit(out, depth, leaves ? "endwhile" : "endrepeat");
  }
  uses_frames_ = true;
  emit(out, depth, "repeat(FRAMES)");
  if (!options_.picture.empty())
    emit(out, depth + 1, fmt::format("PIX = io.image.open('{}')", options_.picture));
  loop_body(out, depth, "", true);
  emit(out, depth, "endrepeat");
}

void KernelSourceReader::translate_while(ProgramLines& out, int depth) {
  ++position_;
  const std::size_t open = position_;
  const std::size_t close = behind_bracket(open);
  const KernelTokenList condition = tokens_between(open + 1, close - 1);
  const bool endless = condition.size() == 1 && (condition[0].is_name("true") || condition[0].text == "1");
  position_ = close;
  if (endless) return translate_frames(out, depth);
  if (const auto plain = plain_expression(condition); plain && is_scalar(plain->type)) {
    emit(out, depth, fmt::format("while({})", plain->text));
    loop_body(out, depth, "");
  } else {
    emit(out, depth, "while(1)");
    emit_leave_unless(condition, out, depth + 1);
    loop_body(out, depth, "");
  }
  emit(out, depth, "endwhile");
}

void KernelSourceReader::translate_leaving(ProgramLines& out, int depth) {
  const bool continues = peek().is_name("continue");
  const std::string word = peek().text;
  auto loop = loops_.rbegin();
  while (continues && loop != loops_.rend() && !loop->break_label.empty()) ++loop;
  if (loop == loops_.rend()) give_up("'{}' outside of a loop", word);
  position_ += 2;
  flow_.guard(loop->node);
  if (!continues && !loop->break_label.empty()) {
    loop->is_used = true;
    return emit(out, depth, fmt::format("jump({})", loop->break_label));
  }
  // APRON's own would continue a loop around the `switch` only from outside of it; the label is the same
  // place.
  if (continues && loop != loops_.rbegin() && loop->continue_label.empty())
    loop->continue_label = label("continue");
  if (!continues || loop->continue_label.empty()) return emit(out, depth, word);
  loop->is_used = true;
  emit(out, depth, fmt::format("jump({})", loop->continue_label));
}

// The statements behind a label run if the value is the label's, or if those before it ran to their end.
void KernelSourceReader::translate_switch(ProgramLines& out, int depth) {
  const std::size_t open = position_ + 1, close = behind_bracket(open);
  const CppValue value = settle(expression(tokens_between(open + 1, close - 1), out, depth), out, depth);
  if (!is_integer(value.type) || !tokens_[close].is("{"))
    give_up("'switch' of '{}' has no counterpart", plain_text(tokens_between(open + 1, close - 1)));
  const std::string chosen = new_name("value"), reached = new_name("reached");
  const std::size_t end = behind_bracket(close);
  // The test for the label at i, which moves behind its colon.
  const auto read_label = [&](std::size_t& i) {
    const std::size_t first = i + 1;
    while (i < end && !tokens_[i].is(":")) ++i;
    const auto constant = plain_expression(tokens_between(first, i++));
    if (!constant || !constant->constant) give_up("the label of a 'case' is no constant");
    return fmt::format("{:.0f}", *constant->constant);
  };
  std::string others;
  for (std::size_t i = close + 1; i + 1 < end;) {
    if (tokens_[i].is_name("case"))
      others += (others.empty() ? "" : " && ") + chosen + " != " + read_label(i);
    else
      i = tokens_[i].opens_bracket() ? behind_bracket(i) : i + 1;
  }
  const ValueFlow::Node node = flow_.add();
  flow_.write(node);
  const ValueFlow::Guard guard(flow_, node);
  loops_.push_back({"", false, node, {}, label("leave")});
  scopes_.emplace_back();
  emit(out, depth, fmt::format("{} = {}", chosen, value.text));
  emit(out, depth, fmt::format("{} = 0", reached));
  position_ = close + 1;
  while (!at_end() && !peek().is("}")) {
    std::string test;
    while (peek().is_name_of({"case", "default"}) || peek().kind == Kind::kComment) {
      if (peek().kind == Kind::kComment) {
        ++position_;
      } else if (peek().is_name("default")) {
        position_ += 2;
        test += (test.empty() ? "" : " || ") + (others.empty() ? "1" : "(" + others + ")");
      } else {
        test += (test.empty() ? "" : " || ") + chosen + " == " + read_label(position_);
      }
    }
    if (!test.empty()) {
      emit(out, depth, fmt::format("if({})", test));
      emit(out, depth + 1, fmt::format("{} = 1", reached));
      emit(out, depth, "endif");
    }
    if (at_end() || peek().is("}")) break;
    emit(out, depth, fmt::format("if({})", reached));
    while (!at_end() && !peek().is("}") && !peek().is_name_of({"case", "default"}))
      translate_statement(out, depth + 1);
    emit(out, depth, "endif");
  }
  ++position_;
  scopes_.pop_back();
  const Loop left = std::move(loops_.back());
  loops_.pop_back();
  if (left.is_used) emit(out, depth, left.break_label);
  if (!left.left_out_break.empty()) flow_.leave_out(node, left.left_out_break);
}

void KernelSourceReader::translate_do(ProgramLines& out, int depth) {
  ++position_;
  emit(out, depth, "while(1)");
  const Loop loop = loop_body(out, depth, label("continue"));
  if (!peek().is_name("while")) give_up("'do' without 'while'");
  const std::size_t open = position_ + 1, close = behind_bracket(open);
  emit_leave_unless(tokens_between(open + 1, close - 1), out, depth + 1);
  flow_.write(loop.node);
  position_ = close;
  consume(";");
  emit(out, depth, "endwhile");
}

void KernelSourceReader::translate_if(ProgramLines& out, int depth) {
  ++position_;
  const std::size_t open = position_;
  const std::size_t close = behind_bracket(open);
  const CppValue condition = settle(expression(tokens_between(open + 1, close - 1), out, depth), out, depth);
  if (!is_scalar(condition.type))
    give_up("'{}' is no condition", plain_text(tokens_between(open + 1, close - 1)));
  position_ = close;
  const ValueFlow::Node node = flow_.add();
  flow_.write(node);
  const ValueFlow::Guard guard(flow_, node);
  emit(out, depth, fmt::format("if({})", condition.text));
  translate_body(out, depth);
  if (peek().is_name("else")) {
    ++position_;
    emit(out, depth, "else");
    translate_body(out, depth);
  }
  emit(out, depth, "endif");
}

void KernelSourceReader::translate_return(ProgramLines& out, int depth) {
  const std::size_t end = statement_end(position_);
  const KernelTokenList words = tokens_between(position_ + 1, end);
  const bool is_last =
      current_ != nullptr && end + 1 < tokens_.size() && end + 2 == current_->end && depth == 0;
  if (current_ != nullptr && current_->name != "main" && !words.empty() &&
      (is_scalar(result_) || current_->deduces_result)) {
    CppValue value = settle(expression(words, out, depth), out, depth);
    if (current_->deduces_result && result_ == CppType::kVoid) result_ = value.type;
    if (!is_scalar(result_)) give_up("'{}' is no number", plain_text(words));
    emit(out, depth, fmt::format("$result = {}", cpp_convert(std::move(value), result_).text));
    flow_.write(current_->signature.value);
  }
  // The statements after a `return` run if it does not.
  if (current_ != nullptr) flow_.guard(current_->signature.call);
  position_ = end;
  consume(";");
  if (is_last || current_ == nullptr) return;
  if (!in_macro_) return emit(out, depth, "end");
  returns_early_ = true;
  emit(out, depth, "jump(:#return)");
}

}  // namespace apron::run
