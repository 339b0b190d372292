#include "xraycast/viewer/viewer_window.hpp"

#include "xraycast/basis_file.hpp"
#include "xraycast/caster.hpp"
#include "xraycast/comparison.hpp"
#include "xraycast/error.hpp"
#include "xraycast/projector.hpp"
#include "xraycast/recast.hpp"
#include "xraycast/scan.hpp"
#include "xraycast/stopwatch.hpp"
#include "xraycast/viewer/headless_context.hpp"
#include "xraycast/viewer/opacity_panel.hpp"
#include "xraycast/viewer/renderer.hpp"
#include "xraycast/viewer/vessels.hpp"
#include "xraycast/viewer/worker.hpp"

#include <epoxy/gl.h>
// GLFW would bring a header of OpenGL of its own.
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <cmath>
#include <imgui.h>
#include <imgui_stdlib.h>
#include <numbers>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr int kCineSteps = 72;

std::string glfw_error() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text ? text : "no reason given";
}

/// GLFW, a window with OpenGL 3.3 core, and Dear ImGui on it.
class Window {
 public:
  Window() {
    if (!glfwInit())
      throw Error("there is no display to open a window on ({}); `xraycast render` needs none", glfw_error());
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
    window_ = glfwCreateWindow(1280, 720, "xraycast", nullptr, nullptr);
    if (!window_) {
      const std::string reason = glfw_error();
      glfwTerminate();
      throw Error("there is no OpenGL 3.3 for a window ({}); `xraycast render` draws without one", reason);
    }
    glfwMakeContextCurrent(window_);
    glfwSwapInterval(1);
    IMGUI_CHECKVERSION();
    ImGui::CreateContext();
    ImGui::GetIO().IniFilename = nullptr;
    float scale = 1;
    glfwGetWindowContentScale(window_, &scale, nullptr);
    ImGui::GetStyle().ScaleAllSizes(scale);
    ImGui::GetIO().FontGlobalScale = scale;
    ImGui::StyleColorsDark();
  }
  ~Window() {
    ImGui_ImplOpenGL3_Shutdown();
    ImGui_ImplGlfw_Shutdown();
    ImGui::DestroyContext();
    glfwDestroyWindow(window_);
    glfwTerminate();
  }
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  /// After our own callbacks are set, which Dear ImGui then calls.
  void attach_gui() {
    ImGui_ImplGlfw_InitForOpenGL(window_, true);
    ImGui_ImplOpenGL3_Init("#version 330 core");
  }

  GLFWwindow* handle() const { return window_; }

 private:
  GLFWwindow* window_ = nullptr;
};

/// What a worker read.
struct Loaded {
  std::shared_ptr<const BodyMap> map;
  std::optional<Basis> basis;
  std::shared_ptr<Device> device;
  std::shared_ptr<ResidentScan> scan;
};

class Viewer {
 public:
  Viewer(GLFWwindow* window, ViewSession session, std::string device)
      : window_(window), session_(std::move(session)), device_choice_(std::move(device)) {
    session_.style.pixels_per_column = 2;
    load();
  }

  void frame();
  void drop(const std::vector<fs::path>& paths);
  void key(int key, int mods);
  bool is_idle() const { return !worker_.status() && !cine_; }

 private:
  // ---- files
  void load();
  void open(const fs::path& path);
  void deliver(Loaded loaded);
  void save_picture();
  void save_cine();
  void attempt(const std::function<void()>& action);

  // ---- what is shown
  void use_map(std::shared_ptr<const BodyMap> map);
  void set_opacity(std::span<const double> mu_per_mm);
  View view_in(int width, int height) const;
  void draw_picture(int x, int y, int width, int height);
  void draw_truth(int x, int y, int width, int height);

  // ---- the person at the table
  void mouse();
  void panel();
  void layers_panel();
  void curve_panel();
  void overlays();
  void remember();
  void step_back(std::vector<ViewSession>& from, std::vector<ViewSession>& to);

  GLFWwindow* window_;
  ViewSession session_;
  std::string device_choice_;
  Renderer renderer_;
  Worker worker_;
  OpacityPanel opacity_panel_;

  std::shared_ptr<const BodyMap> map_;
  std::shared_ptr<Device> device_;
  std::shared_ptr<ResidentScan> scan_;
  std::optional<Basis> basis_;
  std::optional<RecastSession> recast_;
  std::vector<double> mu_per_mm_;
  BodyBounds bounds_;

  std::vector<ViewSession> undo_, redo_;
  bool cine_ = false, help_ = false, split_ = false, truth_ = false;
  std::string message_, to_open_;
  double frame_ms_ = 0, psnr_db_ = 0;
  int pictures_ = 0;
};

// ---- files ----------------------------------------------------------------------------------------

void Viewer::attempt(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::exception& error) {
    message_ = error.what();
  }
}

/// Reads what the session names; without a map, casts the scan.
void Viewer::load() {
  if (!session_.vessels.empty() || !session_.catheter.empty())
    attempt([&] {
      std::vector<Surface> surfaces;
      if (!session_.vessels.empty()) surfaces.push_back(read_vessels(session_.vessels));
      if (!session_.catheter.empty()) surfaces.push_back(read_catheter(session_.catheter));
      renderer_.set_surfaces(surfaces);
    });
  if (session_.map.empty() && session_.scan.empty()) return;
  worker_.start("Opening", [this, session = session_](Progress& progress) -> Worker::Delivery {
    auto loaded = std::make_shared<Loaded>();
    if (!session.basis.empty() || !session.scan.empty())
      loaded->device = std::make_shared<Device>(device_choice_);
    if (!session.map.empty()) loaded->map = std::make_shared<BodyMap>(read_body_map(session.map));
    if (!session.basis.empty()) loaded->basis = read_basis(session.basis);
    if (!session.scan.empty()) {
      const Scan scan = open_scan(session.scan, {}, progress);
      OutlineFinder finder(scan.source->geometry());
      LoadTimings timings;
      loaded->scan = std::make_shared<ResidentScan>(
          xraycast::load(*loaded->device, *scan.source, finder, timings, progress));
      if (!loaded->map) {
        constexpr int kLayers = 8, kAngles = 360;
        const BodyOutline body = finder.finish();
        const MapGeometry geometry =
            cylinder_map(loaded->scan->geometry(), kAngles,
                         shell_radii_mm(RadiiRule::equal_area, kLayers, body.radius_mm), body.centre_mm);
        loaded->map =
            std::make_shared<BodyMap>(cast(*loaded->scan, geometry, Opacity::paper(), progress).map);
        loaded->basis = make_basis(*loaded->scan, geometry, useful_knots_hu(Opacity::paper()), progress);
      }
    }
    return [this, loaded] { deliver(std::move(*loaded)); };
  });
}

void Viewer::deliver(Loaded loaded) {
  recast_.reset();
  scan_.reset();
  if (loaded.device) device_ = std::move(loaded.device);
  scan_ = std::move(loaded.scan);
  basis_ = std::move(loaded.basis);
  use_map(std::move(loaded.map));
  if (!basis_) return;
  recast_.emplace(*device_, *basis_);
  const Opacity start = session_.opacity.value_or(map_->opacity);
  mu_per_mm_.clear();
  for (const double hu : basis_->knots_hu) mu_per_mm_.push_back(start.mu_per_mm(hu));
  if (session_.opacity) set_opacity(mu_per_mm_);
}

void Viewer::open(const fs::path& path) {
  attempt([&] {
    if (!fs::exists(path)) throw InputError("{}: no such file or folder", path.string());
    const std::string extension = path.extension().string();
    message_.clear();
    if (extension == ".json") {
      session_ = read_session(path);
      session_.style.pixels_per_column = 2;
    } else if (extension == ".exr") {
      session_.map = path;
      session_.scan.clear();
      session_.basis.clear();
      session_.opacity.reset();
    } else if (extension == ".basis") {
      session_.basis = path;
    } else if (extension == ".vtp" || extension == ".stl" || fs::exists(path / "surface.vtp") ||
               fs::exists(path / "tree.vtp")) {
      session_.vessels = path;
    } else {
      session_.scan = path;
      session_.map.clear();
      session_.basis.clear();
      session_.opacity.reset();
    }
    load();
  });
}

void Viewer::drop(const std::vector<fs::path>& paths) {
  for (const fs::path& path : paths) open(path);
}

void Viewer::save_picture() {
  attempt([&] {
    int width = 0, height = 0;
    glfwGetFramebufferSize(window_, &width, &height);
    const View view = view_in(width, height);
    fs::path path;
    do path = fmt::format("xraycast-{:03}.png", ++pictures_);
    while (fs::exists(path));
    write_png(renderer_.picture(view, session_.style), width, height, 3, path);
    message_ = "saved " + fs::absolute(path).string();
  });
}

void Viewer::save_cine() {
  attempt([&] {
    constexpr int kWidth = 640, kHeight = 480;
    const fs::path folder = "xraycast-cine";
    fs::create_directories(folder);
    Camera camera = session_.camera;
    for (int i = 0; i < kCineSteps; ++i) {
      write_png(renderer_.picture(view_of(camera, bounds_, kWidth, kHeight), session_.style), kWidth, kHeight,
                3, folder / fmt::format("frame-{:03}.png", i));
      camera.rotate(360.0 / kCineSteps);
    }
    message_ = fmt::format("saved {} frames in {}", kCineSteps, fs::absolute(folder).string());
  });
}

// ---- what is shown --------------------------------------------------------------------------------

void Viewer::use_map(std::shared_ptr<const BodyMap> map) {
  const bool is_first = !map_ || map_->geometry != map->geometry;
  map_ = std::move(map);
  renderer_.set_map(map_);
  bounds_ = bounds_of(map_->geometry);
  if (session_.style.strengths.size() != static_cast<std::size_t>(map_->geometry.layers()))
    session_.style.strengths.assign(static_cast<std::size_t>(map_->geometry.layers()), 1.0f);
  if (!is_first || session_.has_window) return;
  session_.style.window = automatic_window(renderer_.tau(view_of({}, bounds_, 320, 240), session_.style));
  session_.has_window = true;
}

void Viewer::set_opacity(std::span<const double> mu_per_mm) {
  std::vector<Opacity::Knot> knots;
  for (std::size_t i = 0; i < basis_->knots_hu.size(); ++i)
    knots.push_back({basis_->knots_hu[i], mu_per_mm[i]});
  session_.opacity = Opacity("edited", std::move(knots));
  mu_per_mm_.assign(mu_per_mm.begin(), mu_per_mm.end());
  use_map(std::make_shared<BodyMap>(recast_->recast(*session_.opacity)));
}

View Viewer::view_in(int width, int height) const {
  return view_of(session_.camera, bounds_, std::max(1, width), std::max(1, height));
}

void Viewer::draw_picture(int x, int y, int width, int height) {
  renderer_.draw(view_in(width, height), session_.style, x, y);
}

void Viewer::draw_truth(int x, int y, int width, int height) {
  Progress progress;
  const Opacity& opacity = session_.opacity ? *session_.opacity : map_->opacity;
  const ProjectionImage truth = project(*scan_, view_in(width, height), opacity, progress);
  renderer_.draw(truth, session_.style, x, y);
  if (!split_) return;
  Style body_alone = session_.style;
  const std::vector<float> tau = renderer_.tau(truth.view, body_alone);
  psnr_db_ = compare(tau, truth.tau, std::vector<std::uint8_t>(tau.size(), 1), width, height).psnr_db;
}

void Viewer::frame() {
  if (const auto error = worker_.poll()) message_ = *error;
  const Stopwatch stopwatch;
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, width, height);
  glClearColor(0.05f, 0.05f, 0.06f, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  if (cine_) session_.camera.rotate(360.0 / kCineSteps / 2);
  if (map_ && width > 0 && height > 0)
    attempt([&] {
      const bool splits = split_ && scan_;
      const int half = splits ? width / 2 : width;
      if (truth_ && scan_)
        draw_truth(0, 0, half, height);
      else
        draw_picture(0, 0, half, height);
      if (splits) {
        glBindFramebuffer(GL_FRAMEBUFFER, 0);
        draw_truth(half, 0, width - half, height);
      }
    });
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glFinish();
  frame_ms_ = stopwatch.ms();

  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  ImGui::NewFrame();
  mouse();
  panel();
  overlays();
  ImGui::Render();
  glViewport(0, 0, width, height);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

// ---- the person at the table ----------------------------------------------------------------------

void Viewer::mouse() {
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantCaptureMouse || !map_) return;
  const View view = view_in(static_cast<int>(io.DisplaySize.x), static_cast<int>(io.DisplaySize.y));
  Camera& camera = session_.camera;
  if (ImGui::IsMouseDragging(ImGuiMouseButton_Left, 0)) {
    camera.rotate(-0.4 * io.MouseDelta.x);
    if (io.KeyShift || map_->geometry.projection == Projection::sphere) camera.tilt(0.4 * io.MouseDelta.y);
  }
  if (ImGui::IsMouseDragging(ImGuiMouseButton_Middle, 0))
    camera.travel(io.MouseDelta.y * view.pixel_mm, bounds_);
  if (ImGui::IsMouseDragging(ImGuiMouseButton_Right, 0)) {
    GreyWindow& window = session_.style.window;
    const double middle = 0.5 * (window.dark + window.light) + 0.001 * io.MouseDelta.y;
    const double half =
        std::max(0.01, 0.5 * (window.light - window.dark) * std::exp(0.005 * io.MouseDelta.x));
    window.dark = std::clamp(middle - half, 0.0, 0.98);
    window.light = std::clamp(middle + half, window.dark + 0.02, 1.0);
    session_.has_window = true;
  }
  if (io.MouseWheel != 0) camera.magnify(std::pow(1.1, io.MouseWheel));
}

void Viewer::remember() {
  undo_.push_back(session_);
  redo_.clear();
}

void Viewer::step_back(std::vector<ViewSession>& from, std::vector<ViewSession>& to) {
  if (from.empty()) return;
  ViewSession next = from.back();
  from.pop_back();
  to.push_back(session_);
  const Camera camera = session_.camera;
  session_ = std::move(next);
  session_.camera = camera;
  if (!recast_) return;
  const Opacity opacity = session_.opacity.value_or(basis_ && map_ ? Opacity::paper() : map_->opacity);
  std::vector<double> mu;
  for (const double hu : basis_->knots_hu) mu.push_back(opacity.mu_per_mm(hu));
  const bool is_own = !session_.opacity;
  set_opacity(mu);
  if (is_own) session_.opacity.reset();
}

void Viewer::key(int key, int mods) {
  Style& style = session_.style;
  const bool control = (mods & GLFW_MOD_CONTROL) != 0;
  if (control && key == GLFW_KEY_Z) return step_back(undo_, redo_);
  if (control && key == GLFW_KEY_Y) return step_back(redo_, undo_);
  if (control && key == GLFW_KEY_S)
    return attempt([&] {
      write_session(session_, "xraycast-session.json");
      message_ = "saved " + fs::absolute("xraycast-session.json").string();
    });
  if (control && key == GLFW_KEY_O) {
    to_open_ = fs::current_path().string() + "/";
    return ImGui::OpenPopup("Open");
  }
  if (key >= GLFW_KEY_1 && key <= GLFW_KEY_9) {
    const auto layer = static_cast<std::size_t>(key - GLFW_KEY_1);
    if (layer >= style.strengths.size()) return;
    remember();
    style.strengths[layer] = style.strengths[layer] > 0 ? 0.0f : 1.0f;
    return;
  }
  switch (key) {
    case GLFW_KEY_R:
      session_.camera = {};
      break;
    case GLFW_KEY_F:
      style.look = style.look == Look::fluoro ? Look::surface : Look::fluoro;
      style.window.inverted = style.look == Look::surface;
      break;
    case GLFW_KEY_C:
      if (style.sampling.compositing == Compositing::path && !truth_) {
        style.sampling.compositing = Compositing::wall;
      } else {
        truth_ = scan_ && !truth_;
        style.sampling.compositing = Compositing::path;
      }
      break;
    case GLFW_KEY_I:
      style.window.inverted = !style.window.inverted;
      break;
    case GLFW_KEY_P:
      save_picture();
      break;
    case GLFW_KEY_SPACE:
      cine_ = !cine_;
      break;
    case GLFW_KEY_H:
    case GLFW_KEY_SLASH:
      help_ = !help_;
      break;
    default:
      break;
  }
}

void Viewer::layers_panel() {
  auto& strengths = session_.style.strengths;
  for (std::size_t k = 0; k < strengths.size(); ++k) {
    ImGui::PushID(static_cast<int>(k));
    ImGui::SliderFloat("##strength", &strengths[k], 0, 2,
                       fmt::format("layer {}: {:.0f}-{:.0f} mm  %.2f", k + 1, map_->geometry.radii_mm[k],
                                   map_->geometry.radii_mm[k + 1])
                           .c_str());
    if (ImGui::IsItemActivated()) remember();
    ImGui::PopID();
  }
}

void Viewer::curve_panel() {
  const std::string why_not =
      recast_ ? "" : "no basis: open one (--basis FILE),\nor a scan, to edit the opacity";
  const std::span<const double> knots =
      basis_ ? std::span<const double>(basis_->knots_hu) : std::span<const double>();
  const std::span<const std::int64_t> histogram =
      basis_ ? std::span<const std::int64_t>(basis_->hu_histogram) : std::span<const std::int64_t>();
  const auto edit = opacity_panel_.draw(knots, mu_per_mm_, histogram, Basis::kHistogramBin_hu, why_not);
  if (edit.knot >= 0) {
    if (edit.began) remember();
    std::vector<double> mu = mu_per_mm_;
    mu[edit.knot] = edit.mu_per_mm;
    attempt([&] { set_opacity(mu); });
  }
  if (!recast_) return;
  for (const char* preset : kOpacityPresets) {
    if (ImGui::SmallButton(preset)) {
      remember();
      attempt([&] { set_opacity(preset_mu_per_mm(preset, basis_->knots_hu)); });
    }
    ImGui::SameLine();
  }
  ImGui::NewLine();
}

void Viewer::panel() {
  const float width = 23 * ImGui::GetFontSize();
  ImGui::SetNextWindowPos({8, 8}, ImGuiCond_FirstUseEver);
  ImGui::SetNextWindowSize({width, 0}, ImGuiCond_FirstUseEver);
  ImGui::Begin("xraycast", nullptr, ImGuiWindowFlags_AlwaysAutoResize);
  Style& style = session_.style;
  for (const CameraPreset& preset : kCameraPresets) {
    if (ImGui::Button(preset.name)) session_.camera.angle_rad = preset.angle_deg * std::numbers::pi / 180;
    ImGui::SameLine();
  }
  if (ImGui::Button("Reset")) session_.camera = {};
  int look = style.look == Look::fluoro ? 0 : 1;
  if (ImGui::Combo("look", &look, "fluoro\0surface\0")) style.look = look == 0 ? Look::fluoro : Look::surface;
  int compositing = truth_ ? 2 : style.sampling.compositing == Compositing::path ? 0 : 1;
  if (ImGui::Combo("compositing", &compositing, scan_ ? "path\0wall\0true\0" : "path\0wall\0")) {
    truth_ = compositing == 2;
    style.sampling.compositing = compositing == 1 ? Compositing::wall : Compositing::path;
  }
  bool is_continuous = style.sampling.reconstruction == Reconstruction::linear;
  if (ImGui::Checkbox("continuous between layers", &is_continuous))
    style.sampling.reconstruction = is_continuous ? Reconstruction::linear : Reconstruction::constant;
  ImGui::Checkbox("inverted", &style.window.inverted);
  ImGui::SameLine();
  if (scan_)
    ImGui::Checkbox("split with the true projection", &split_);
  else
    ImGui::TextDisabled("(open a scan for true projections)");
  auto gamma = static_cast<float>(style.window.gamma);
  if (ImGui::SliderFloat("gamma", &gamma, 0.4f, 2.5f)) style.window.gamma = gamma;
  if (map_ && ImGui::CollapsingHeader("Layers")) layers_panel();
  if (map_ && ImGui::CollapsingHeader("Opacity", ImGuiTreeNodeFlags_DefaultOpen)) curve_panel();
  if (ImGui::Button("Picture")) save_picture();
  ImGui::SameLine();
  if (ImGui::Button("Cine")) save_cine();
  ImGui::SameLine();
  if (ImGui::Button("Undo")) step_back(undo_, redo_);
  ImGui::SameLine();
  if (ImGui::Button("Redo")) step_back(redo_, undo_);
  if (const auto status = worker_.status()) {
    ImGui::ProgressBar(static_cast<float>(status->fraction), {-1, 0},
                       fmt::format("{}: {}", status->name, status->stage).c_str());
    if (ImGui::Button("Cancel")) worker_.cancel();
  }
  if (!message_.empty()) ImGui::TextWrapped("%s", message_.c_str());
  ImGui::End();
}

void Viewer::overlays() {
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float line = ImGui::GetFontSize();
  const ImU32 colour = IM_COL32(255, 210, 90, 255);
  const auto text = [&](float x, float y, const std::string& words) {
    draw.AddText({x + 1, y + 1}, IM_COL32(0, 0, 0, 255), words.c_str());
    draw.AddText({x, y}, colour, words.c_str());
  };
  if (map_) {
    // Who stands where: at 0 deg the patient's left is on the right.
    const double degrees = std::remainder(session_.camera.angle_rad * 180 / std::numbers::pi, 360.0);
    constexpr const char* kRound[] = {"L", "P", "R", "A"};  // on the picture's right at 0, 90, 180, 270 deg
    const int quarter = (static_cast<int>(std::lround(degrees / 90)) + 4) % 4;
    text(size.x - 2 * line, size.y / 2, kRound[quarter]);
    text(line, size.y / 2, kRound[(quarter + 2) % 4]);
    text(size.x / 2, line / 2, "S");
    text(size.x / 2, size.y - 2 * line, "I");
    const View view = view_in(static_cast<int>(size.x), static_cast<int>(size.y));
    const double at_axis =
        view.pixel_mm / (view.cone ? view.cone->source_detector_mm / view.cone->source_axis_mm : 1);
    const auto bar = static_cast<float>(50 / at_axis);
    const float y = size.y - 3 * line;
    draw.AddLine({size.x - 2 * line - bar, y}, {size.x - 2 * line, y}, colour, 2);
    text(size.x - 2 * line - bar, y - 1.3f * line, "50 mm");
  }
  const std::string split = split_ && scan_ ? fmt::format("   PSNR {:.1f} dB", psnr_db_) : "";
  text(line, size.y - 1.4f * line,
       fmt::format("{}   {:.0f} ms   {:.0f} x {:.0f}   {}   {:.1f} MB{}", status_of(session_.camera),
                   frame_ms_, size.x, size.y, gl_device_name(),
                   static_cast<double>(renderer_.texture_B()) / 1e6, split));
  if (!map_ && !worker_.status())
    text(size.x / 2 - 12 * line, size.y / 2,
         "Drop a body map, a scan, vessels or a session here, or press Ctrl+O");
  if (help_) {
    ImGui::SetNextWindowPos({size.x / 2, size.y / 2}, ImGuiCond_Always, {0.5f, 0.5f});
    ImGui::Begin("Help", &help_, ImGuiWindowFlags_AlwaysAutoResize);
    ImGui::TextUnformatted(
        "left drag      rotate (with Shift also tilt)\nwheel          zoom\nmiddle drag    move the table\n"
        "right drag     window and level\nR              reset\n1 .. 9         layers\nF              look\n"
        "C              compositing\nI              invert\nP              picture\nSpace          cine "
        "rotation\n"
        "Ctrl+O         open\nCtrl+S         save the session\nCtrl+Z, Ctrl+Y undo, redo\nH or ?         "
        "this help");
    ImGui::End();
  }
  if (ImGui::BeginPopup("Open")) {
    ImGui::InputText("file or folder", &to_open_);
    if (ImGui::Button("Open") || ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Enter))) {
      open(to_open_);
      ImGui::CloseCurrentPopup();
    }
    ImGui::EndPopup();
  }
}

Viewer& viewer_of(GLFWwindow* window) { return *static_cast<Viewer*>(glfwGetWindowUserPointer(window)); }

}  // namespace

void run_viewer(const ViewSession& session, const std::string& device, const Progress& progress) {
  Window window;
  GLFWwindow* handle = window.handle();
  Viewer viewer(handle, session, device);
  glfwSetWindowUserPointer(handle, &viewer);
  glfwSetDropCallback(handle, [](GLFWwindow* w, int count, const char** paths) {
    viewer_of(w).drop({paths, paths + count});
  });
  glfwSetKeyCallback(handle, [](GLFWwindow* w, int key, int, int action, int mods) {
    if (action == GLFW_PRESS && !ImGui::GetIO().WantTextInput) viewer_of(w).key(key, mods);
  });
  window.attach_gui();
  while (!glfwWindowShouldClose(handle) && !progress.cancelled()) {
    // Frames are drawn when something happens, and a few more for what ImGui settles late.
    constexpr double kSlow_s = 0.1;
    viewer.is_idle() ? glfwWaitEventsTimeout(kSlow_s) : glfwPollEvents();
    viewer.frame();
    glfwSwapBuffers(handle);
  }
}

}  // namespace xraycast
