#include "apron/ui/Offscreen.h"

#include <backends/imgui_impl_opengl3.h>
#include <epoxy/gl.h>

#include <vector>

#include "apron/ui/Gui.h"
#include "apron/ui/OffscreenContext.h"
#include "apron/ui/Panels.h"
#include "apron/ui/Textures.h"

namespace apron::ui {
namespace {

constexpr int kMostPixels = 8192;
// Passes until sizes, scroll positions and the registers in sight have settled.
constexpr int kPasses = 4;

}  // namespace

struct Offscreen::State {
  State(int w, int h, float scale) : width(w), height(h), gui(scale) {
    glGenFramebuffers(1, &framebuffer);
    glGenRenderbuffers(1, &colour);
    glBindRenderbuffer(GL_RENDERBUFFER, colour);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, width, height);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour);
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
      throw PictureError("this machine draws no picture of " + std::to_string(width) + "x" +
                         std::to_string(height) + " pixels");
    ImGuiIO& io = ImGui::GetIO();
    io.DisplaySize = {static_cast<float>(width), static_cast<float>(height)};
    io.DeltaTime = 1.0F / 60.0F;  // and not the clock's: the same input, the same picture
    for (int key = 0; key < ImGuiKey_COUNT; ++key) io.KeyMap[key] = key;
  }
  ~State() {
    glDeleteRenderbuffers(1, &colour);
    glDeleteFramebuffers(1, &framebuffer);
  }

  int width, height;
  OffscreenContext context;
  Gui gui;
  Textures textures;
  GLuint framebuffer = 0, colour = 0;
};

Offscreen::Offscreen(int width, int height, float scale) {
  if (width < 1 || height < 1 || width > kMostPixels || height > kMostPixels)
    throw PictureError("a picture has 1 to " + std::to_string(kMostPixels) + " pixels an edge");
  state_ = std::make_unique<State>(width, height, scale);
}

Offscreen::~Offscreen() = default;

void Offscreen::point(float x, float y, bool down, float wheel) {
  ImGuiIO& io = ImGui::GetIO();
  io.MousePos = {x, y};
  io.MouseDown[0] = down;
  io.MouseWheel = wheel;
}

void Offscreen::type(unsigned character) { ImGui::GetIO().AddInputCharacter(character); }

Image Offscreen::draw(Workbench& bench) {
  State& s = *state_;
  ImGui_ImplOpenGL3_NewFrame();
  ImGui::NewFrame();
  Stage stage{bench, s.textures, s.gui};
  draw_window(stage);
  ImGui::Render();
  glBindFramebuffer(GL_FRAMEBUFFER, s.framebuffer);
  glViewport(0, 0, s.width, s.height);
  glClearColor(1.0F, 1.0F, 1.0F, 1.0F);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  return read_pixels(s.width, s.height);
}

Image Offscreen::settle(Workbench& bench) {
  for (int i = 1; i < kPasses; ++i) draw(bench);
  return draw(bench);
}

unsigned Offscreen::take_error() { return glGetError(); }
std::uint64_t Offscreen::uploads() const { return state_->textures.uploads(); }

}  // namespace apron::ui
