// The program panel while it edits: the text of a file with line numbers, and the compiler's messages.
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "apron/ui/panels/Panels.h"

namespace apron::ui {
namespace {

constexpr std::size_t kShownDiagnostics = 4;  // the others are reached by scrolling

std::string base_name(const std::string& path) { return std::filesystem::path(path).filename().string(); }

// The byte at which a 1-based line and column begin; columns count characters of UTF-8.
int byte_offset(const ImGuiInputTextCallbackData& text, const ProgramEditor::Position& at) {
  int offset = 0;
  for (std::uint32_t line = 1; line < at.line && offset < text.BufTextLen; ++offset)
    if (text.Buf[offset] == '\n') ++line;
  for (std::uint32_t column = 1; column < at.column && offset < text.BufTextLen; ++column) {
    if (text.Buf[offset] == '\n') break;
    do ++offset;
    while (offset < text.BufTextLen && (static_cast<unsigned char>(text.Buf[offset]) & 0xC0U) == 0x80U);
  }
  return offset;
}

// Moves the cursor to the position that user data points to, once the text has the focus.
int move_cursor(ImGuiInputTextCallbackData* text) {
  auto& position = *static_cast<std::optional<ProgramEditor::Position>*>(text->UserData);
  if (!position) return 0;
  text->CursorPos = byte_offset(*text, *position);
  text->ClearSelection();
  position.reset();
  return 0;
}

void draw_editor_header(DrawContext& context) {
  ViewModel& model = context.model;
  ProgramEditor& editor = model.editor;
  const ProgramEditor::File& file = *editor.current();
  if (ImGui::Button("Done")) editor.shown = false;
  draw_tooltip("Back to the listing; unsaved changes are kept");
  ImGui::SameLine();
  ImGui::BeginDisabled(!file.modified());
  if (ImGui::Button("Save")) editor.request_save();
  draw_tooltip("Write the file, compile and restart the program (Ctrl-S)",
               ImGuiHoveredFlags_AllowWhenDisabled);
  ImGui::SameLine();
  if (ImGui::Button("Revert")) editor.revert();
  draw_tooltip("Discard the unsaved changes", ImGuiHoveredFlags_AllowWhenDisabled);
  ImGui::EndDisabled();
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-1.0F);
  const auto label = [](const ProgramEditor::File& one) {
    return base_name(one.name) + (one.modified() ? "  (unsaved)" : "");
  };
  if (ImGui::BeginCombo("##file", label(file).c_str())) {
    for (std::size_t i = 0; i < editor.files().size(); ++i)
      if (ImGui::Selectable((label(editor.files()[i]) + "##" + std::to_string(i)).c_str(),
                            &editor.files()[i] == &file))
        editor.select(i);
    ImGui::EndCombo();
  }
}

// Line numbers to the left of the text, and a mark on the lines that the compiler complains about.
void draw_line_numbers(const DrawContext& context, const ProgramEditor::File& file, ImVec2 corner,
                       float width, ImVec2 text_size, float scroll) {
  const float height = ImGui::GetFontSize(), top = corner.y + ImGui::GetStyle().FramePadding.y - scroll;
  const auto lines = static_cast<int>(std::ranges::count(file.text, '\n')) + 1;
  const int first = std::max(0, static_cast<int>((corner.y - top) / height));
  const int last = std::min(lines, static_cast<int>((corner.y + text_size.y - top) / height) + 1);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  list.PushClipRect(corner, {corner.x + width + text_size.x, corner.y + text_size.y}, true);
  for (int i = first; i < last; ++i) {
    const float y = top + height * static_cast<float>(i);
    const std::string number = std::to_string(i + 1);
    const auto complaint =
        std::ranges::find_if(context.model.editor.diagnostics, [&](const debugger::SourceDiagnostic& d) {
          return d.file == file.name && d.line == static_cast<unsigned>(i) + 1;
        });
    const bool marked = complaint != context.model.editor.diagnostics.end();
    if (marked) {
      const ImVec2 end{corner.x + width + text_size.x, y + height};
      list.AddRectFilled({corner.x, y}, end,
                         complaint->is_warning ? IM_COL32(235, 170, 40, 60) : IM_COL32(200, 44, 40, 46));
      if (ImGui::IsMouseHoveringRect({corner.x, y}, {corner.x + width, y + height}))
        ImGui::SetTooltip("%s", complaint->message.c_str());
    }
    list.AddText({corner.x + width - context.to_pixels(6) - ImGui::CalcTextSize(number.c_str()).x, y},
                 marked ? theme::kStop : theme::kFaint, number.c_str());
  }
  list.PopClipRect();
}

void draw_text(DrawContext& context, ImVec2 size, bool read_only) {
  ProgramEditor& editor = context.model.editor;
  ProgramEditor::File& file = *editor.current();
  static std::optional<ProgramEditor::Position> position;
  if (const auto wanted = editor.take_position()) position = wanted;
  ImGui::PushFont(context.gui.code());
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const float gutter = 5.0F * ImGui::CalcTextSize("0").x;
  const ImVec2 text_size{std::max(1.0F, size.x - gutter), size.y};
  ImGui::SetCursorScreenPos({corner.x + gutter, corner.y});
  // A text of another revision is another widget, which does not write back what it showed before.
  ImGui::PushID(file.name.c_str());
  ImGui::PushID(static_cast<int>(file.revision));
  if (position) ImGui::SetKeyboardFocusHere();
  ImGui::PushStyleColor(ImGuiCol_FrameBg, ImGui::GetStyleColorVec4(ImGuiCol_ChildBg));
  ImGui::InputTextMultiline("##text", &file.text, text_size,
                            ImGuiInputTextFlags_AllowTabInput | ImGuiInputTextFlags_CallbackAlways |
                                (read_only ? ImGuiInputTextFlags_ReadOnly : 0),
                            move_cursor, &position);
  const bool focused = ImGui::IsItemActive();
  ImGui::PopStyleColor();
  const ImVec2 below = ImGui::GetCursorScreenPos();
  // The text scrolls in a child window of its label and size, of which this is a continuation.
  ImGui::BeginChild("##text", text_size, true, ImGuiWindowFlags_NoMove);
  const float scroll = ImGui::GetScrollY();
  ImGui::EndChild();
  ImGui::SetCursorScreenPos(below);
  ImGui::PopID();
  ImGui::PopID();
  draw_line_numbers(context, file, corner, gutter, text_size, scroll);
  ImGui::PopFont();
  if (focused && ImGui::GetIO().KeyCtrl && ImGui::IsKeyPressed('S', false)) editor.request_save();
}

// A click on a message leads to its place.
void draw_diagnostics(DrawContext& context) {
  ProgramEditor& editor = context.model.editor;
  ImGui::BeginChild("diagnostics");
  for (std::size_t i = 0; i < editor.diagnostics.size(); ++i) {
    const debugger::SourceDiagnostic& d = editor.diagnostics[i];
    const std::string place =
        base_name(d.file) + ":" + std::to_string(d.line) + ":" + std::to_string(d.column);
    const std::string text = place + (d.is_warning ? "  warning: " : "  ") + d.message;
    ImGui::PushID(static_cast<int>(i));
    const float width = ImGui::GetContentRegionAvail().x;
    const ImVec2 at = ImGui::GetCursorScreenPos(),
                 size = ImGui::CalcTextSize(text.c_str(), nullptr, false, width);
    if (ImGui::Selectable("##message", false, 0, {width, size.y})) editor.open(d.file, d.line, d.column);
    ImGui::PopID();
    ImGui::GetWindowDrawList()->AddText(ImGui::GetFont(), ImGui::GetFontSize(), at,
                                        d.is_warning ? ImGui::GetColorU32(ImGuiCol_Text) : theme::kStop,
                                        text.c_str(), nullptr, width);
  }
  ImGui::EndChild();
}

}  // namespace

void draw_editor(DrawContext& context) {
  ProgramEditor& editor = context.model.editor;
  draw_editor_header(context);
  const std::uint32_t line = editor.current()->uneditable_line();
  if (line > 0)
    ImGui::TextWrapped("Line %u has a character that this editor does not keep: edit the file elsewhere",
                       line);
  const ImVec2 available = ImGui::GetContentRegionAvail();
  const auto rows = static_cast<float>(std::min(editor.diagnostics.size(), kShownDiagnostics));
  const float below = rows > 0.0F ? rows * 2.0F * ImGui::GetTextLineHeightWithSpacing() : 0.0F;
  draw_text(context, {available.x, std::max(available.y - below, 0.5F * available.y)}, line > 0);
  if (!editor.diagnostics.empty()) draw_diagnostics(context);
}

}  // namespace apron::ui
