#include "xraycast/window/window.hpp"

#include "xraycast/base/error.hpp"

#include <epoxy/gl.h>
// Keeps GLFW from including its own OpenGL header.
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <cmath>
#include <fontconfig/fontconfig.h>
#include <imgui.h>
#include <memory>
#include <string>
#include <utility>

namespace xraycast {
namespace {

std::string glfw_error() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text ? text : "no reason given";
}

/// The file of the font that saved pictures are written in; empty where the computer has no fonts.
std::string font_file() {
  using Pattern = std::unique_ptr<FcPattern, decltype(&FcPatternDestroy)>;
  const Pattern wanted(FcPatternBuild(nullptr, FC_FAMILY, FcTypeString, "DejaVu Sans", nullptr),
                       FcPatternDestroy);
  FcConfigSubstitute(nullptr, wanted.get(), FcMatchPattern);
  FcDefaultSubstitute(wanted.get());
  FcResult result = FcResultNoMatch;
  const Pattern found(FcFontMatch(nullptr, wanted.get(), &result), FcPatternDestroy);
  FcChar8* file = nullptr;
  if (!found || FcPatternGetString(found.get(), FC_FILE, 0, &file) != FcResultMatch) return {};
  return reinterpret_cast<const char*>(file);
}

/// Fonts that are legible at the window's first size on a screen of usual density; the second is for numbers.
void load_fonts(float scale) {
  constexpr float kText_px = 15, kNumbers_px = 24;
  static constexpr ImWchar kGlyphs[] = {0x20, 0xFF, 0x2190, 0x2193, 0};  // Latin, and arrows
  ImFontAtlas& fonts = *ImGui::GetIO().Fonts;
  const std::string file = font_file();
  for (const float size_px : {kText_px, kNumbers_px}) {
    ImFontConfig built_in;
    built_in.SizePixels = std::round(scale * size_px);
    if (file.empty() || !fonts.AddFontFromFileTTF(file.c_str(), built_in.SizePixels, nullptr, kGlyphs))
      fonts.AddFontDefault(&built_in);
  }
}

void set_style(float scale) {
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowRounding = style.FrameRounding = 3;
  const ImVec4 raised(0.16f, 0.18f, 0.21f, 1), button(0.23f, 0.26f, 0.31f, 1), marked(0.51f, 0.75f, 1, 1);
  for (const auto& [part, colour] :
       {std::pair(ImGuiCol_WindowBg, ImVec4(0.07f, 0.08f, 0.09f, 0.96f)),
        std::pair(ImGuiCol_TextDisabled, ImVec4(0.62f, 0.66f, 0.70f, 1)), std::pair(ImGuiCol_FrameBg, raised),
        std::pair(ImGuiCol_TitleBgActive, raised), std::pair(ImGuiCol_Button, button),
        std::pair(ImGuiCol_Header, button), std::pair(ImGuiCol_CheckMark, marked),
        std::pair(ImGuiCol_SliderGrab, marked)})
    style.Colors[part] = colour;
  style.ScaleAllSizes(scale);
}

}  // namespace

Window::Window() {
  if (!glfwInit())
    throw Error("no display to open a window on ({}); `xraycast render` needs none", glfw_error());
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
  window_ = glfwCreateWindow(1280, 720, "xraycast", nullptr, nullptr);
  if (!window_) {
    const std::string reason = glfw_error();
    glfwTerminate();
    throw Error("no OpenGL 3.3 for a window ({}); `xraycast render` draws without one", reason);
  }
  glfwMakeContextCurrent(window_);
  glfwSwapInterval(1);
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;
  float density = 1;
  glfwGetWindowContentScale(window_, &density, nullptr);
  const float scale = std::round(8 * density) / 8;  // displays report some thousandths less than they have
  load_fonts(scale);
  set_style(scale);
}

Window::~Window() {
  if (ImGui::GetIO().BackendRendererUserData) ImGui_ImplOpenGL3_Shutdown();
  if (ImGui::GetIO().BackendPlatformUserData) ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
  glfwDestroyWindow(window_);
  glfwTerminate();
}

void Window::attach_gui() {
  ImGui_ImplGlfw_InitForOpenGL(window_, true);
  ImGui_ImplOpenGL3_Init("#version 330 core");
}

Window::Size Window::framebuffer() const {
  Size size;
  glfwGetFramebufferSize(window_, &size.width, &size.height);
  return size;
}

void Window::begin_gui() {
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  ImGui::NewFrame();
}

void Window::end_gui() {
  ImGui::Render();
  const Size size = framebuffer();
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, size.width, size.height);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  glfwSwapBuffers(window_);
}

}  // namespace xraycast
