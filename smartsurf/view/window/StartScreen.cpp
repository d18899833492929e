#include "smartsurf/view/window/StartScreen.h"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "common/text/Words.h"
#include "smartsurf/view/gl/GlObjects.h"
#include "smartsurf/view/panels/Hud.h"
#include "smartsurf/view/panels/Icons.h"
#include "smartsurf/view/panels/Panels.h"
#include "smartsurf/view/window/GlfwContext.h"

namespace smartsurf::view {
namespace {

namespace fs = std::filesystem;

constexpr double kIdleWait_s = 0.1;
constexpr float kSideWidth = 330.0f;  // points at scale 1

class StartScreen {
 public:
  explicit StartScreen(const StartContents& contents)
      : contents_(contents),
        glfw_("smartsurf", 1180, 720, WindowPlacement::kDefault),
        scale_(glfw_.content_scale()),
        imgui_(install_callbacks(), scale_),
        folder_(fs::current_path()),
        tiles_(make_texture()) {
    if (contents.tiles.rgb.empty()) return;
    glBindTexture(GL_TEXTURE_2D, tiles_.id());
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB8, contents.tiles.width, contents.tiles.height, 0, GL_RGB,
                 GL_UNSIGNED_BYTE, contents.tiles.rgb.data());
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  }

  std::string choose(const std::atomic<bool>& stop) {
    // ImGui needs a few frames to lay out what appears.
    for (int drawn = 0; !stop && chosen_.empty() && glfwWindowShouldClose(glfw_.window()) == GLFW_FALSE;
         ++drawn) {
      if (drawn < 5)
        glfwPollEvents();
      else
        glfwWaitEventsTimeout(kIdleWait_s);
      if (!glfw_.minimised()) draw();
    }
    return chosen_;
  }

 private:
  GLFWwindow* install_callbacks() {
    glfwSetWindowUserPointer(glfw_.window(), this);
    glfwSetDropCallback(glfw_.window(), [](GLFWwindow* window, int count, const char** files) {
      if (count > 0) static_cast<StartScreen*>(glfwGetWindowUserPointer(window))->chosen_ = files[0];
    });
    glfwSetKeyCallback(glfw_.window(), [](GLFWwindow* window, int key, int, int action, int) {
      if (key == GLFW_KEY_ESCAPE && action == GLFW_PRESS) glfwSetWindowShouldClose(window, GLFW_TRUE);
    });
    return glfw_.window();
  }

  void draw() {
    int width = 0, height = 0;
    glfwGetFramebufferSize(glfw_.window(), &width, &height);
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    ImGui::NewFrame();
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    const float side = std::min(kSideWidth * scale_, 0.45f * size.x);
    draw_side({0.0f, 0.0f, side, size.y});
    draw_gallery({side, 0.0f, size.x - side, size.y});
    ImGui::Render();
    glViewport(0, 0, width, height);
    glClear(GL_COLOR_BUFFER_BIT);
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
    glfwSwapBuffers(glfw_.window());
  }

  static void draw_title(const char* text) {
    ImGui::PushFont(ImGui::GetIO().Fonts->Fonts.back());  // of setup_imgui_style()
    ImGui::TextUnformatted(text);
    ImGui::PopFont();
  }

  void draw_side(const DockRect& area) {
    begin_dock("side", area);
    if (!contents_.message.empty()) {
      ImGui::PushTextWrapPos(0.0f);
      ImGui::TextColored({0.72f, 0.12f, 0.10f, 1.0f}, "%s", contents_.message.c_str());
      ImGui::PopTextWrapPos();
      ImGui::Spacing();
    }
    if (!contents_.recent.empty()) {
      draw_title("Recent");
      for (const std::string& file : contents_.recent) {
        if (ImGui::Selectable((fs::path(file).filename().string() + "##" + file).c_str())) chosen_ = file;
        if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", file.c_str());
      }
      ImGui::Spacing();
    }
    draw_title("Open");
    draw_folder();
    ImGui::End();
  }

  // The folders, experiments and recordings of a folder.
  void draw_folder() {
    if (!listed_) list_folder();
    ImGui::TextDisabled("%s", folder_.c_str());
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", folder_.c_str());
    ImGui::BeginChild("files");
    std::optional<fs::path> entered;
    if (folder_.has_relative_path() && ImGui::Selectable("..")) entered = folder_.parent_path();
    for (const fs::path& entry : entries_) {
      const bool is_folder = !entry.has_filename();
      const std::string name =
          is_folder ? entry.parent_path().filename().string() + "/" : entry.filename().string();
      if (!ImGui::Selectable(name.c_str())) continue;
      if (is_folder)
        entered = entry.parent_path();
      else
        chosen_ = entry.string();
    }
    if (entries_.empty()) ImGui::TextDisabled("neither .lua nor .h5 here");
    ImGui::EndChild();
    if (!entered) return;
    folder_ = *entered;
    listed_ = false;
  }

  // Folders end in a slash.
  void list_folder() {
    listed_ = true;
    entries_.clear();
    std::error_code error, ignored;
    for (fs::directory_iterator at(folder_, error), end; !error && at != end; at.increment(error)) {
      const fs::path& path = at->path();
      if (path.filename().string().starts_with('.')) continue;
      const std::string extension = path.extension().string();
      if (at->is_directory(ignored))
        entries_.push_back(path / "");
      else if (extension == ".lua" || extension == ".h5" || extension == ".hdf5")
        entries_.push_back(path);
    }
    std::ranges::sort(entries_, {}, [](const fs::path& path) {
      return std::pair(path.has_filename(), common::lower_case(path.string()));
    });
  }

  void draw_gallery(const DockRect& area) {
    begin_dock("gallery", area);
    ImGui::SetNextItemWidth(std::min(300.0f * scale_, ImGui::GetContentRegionAvail().x));
    ImGui::InputTextWithHint("##search", "search the experiments", search_, sizeof search_);
    ImGui::BeginChild("tiles");
    const std::string words = common::lower_case(search_);
    const float tile = kTileWidth * scale_, gap = ImGui::GetStyle().ItemSpacing.x;
    const int columns =
        std::max(1, static_cast<int>((ImGui::GetContentRegionAvail().x + gap) / (tile + gap)));
    std::string section;
    int column = 0;
    for (std::size_t i = 0; i < contents_.items.size(); ++i) {
      const GalleryItem& item = contents_.items[i];
      if (common::lower_case(item.section + " " + item.title + " " + item.file).find(words) ==
          std::string::npos)
        continue;
      if (item.section != section) {
        section = item.section;
        ImGui::Spacing();
        draw_title(section.c_str());
        column = 0;
      }
      if (column++ % columns != 0) ImGui::SameLine();
      draw_tile(item, i, tile);
    }
    if (section.empty())
      ImGui::TextDisabled(contents_.items.empty() ? "the gallery is not installed" : "nothing matches");
    ImGui::EndChild();
    ImGui::End();
  }

  void draw_tile(const GalleryItem& item, std::size_t index, float width) {
    const float height = width * kTileHeight / kTileWidth;
    const float x = static_cast<float>(index % kTileColumns * kTileWidth),
                y = static_cast<float>(index / kTileColumns * kTileHeight);
    const auto w = static_cast<float>(contents_.tiles.width), h = static_cast<float>(contents_.tiles.height);
    ImGui::BeginGroup();
    const ImVec2 corner = ImGui::GetCursorScreenPos();
    if (ImGui::InvisibleButton(item.file.c_str(), {width, height + ImGui::GetTextLineHeightWithSpacing()}))
      chosen_ = item.file;
    const bool hovered = ImGui::IsItemHovered();
    if (hovered) ImGui::SetTooltip("smartsurf run %s --window", item.file.c_str());
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const ImVec2 high(corner.x + width, corner.y + height);
    if (h > 0.0f && y + kTileHeight <= h)
      list.AddImageRounded(reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(tiles_.id())), corner,
                           high, {x / w, y / h}, {(x + kTileWidth) / w, (y + kTileHeight) / h},
                           IM_COL32_WHITE, 6.0f * scale_);
    list.AddRect(corner, high, hovered ? IM_COL32(41, 107, 184, 255) : IM_COL32(178, 188, 201, 255),
                 6.0f * scale_, 0, hovered ? 3.0f * scale_ : 1.0f);
    list.PushClipRect(corner, {high.x, high.y + 2.0f * ImGui::GetTextLineHeight()}, true);
    list.AddText({corner.x + 2.0f, high.y + 2.0f * scale_}, ImGui::GetColorU32(ImGuiCol_Text),
                 item.title.c_str());
    list.PopClipRect();
    ImGui::EndGroup();
  }

  const StartContents& contents_;
  GlfwContext glfw_;
  float scale_;
  ImGuiBackend imgui_;
  fs::path folder_;
  std::vector<fs::path> entries_;
  bool listed_ = false;
  char search_[64] = "";
  std::string chosen_;
  Texture tiles_;
};

}  // namespace

std::string choose_file(const StartContents& contents, const std::atomic<bool>& stop) {
  return StartScreen(contents).choose(stop);
}

}  // namespace smartsurf::view
