#pragma once

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <igtlClientSocket.h>
#include <igtlImageMessage.h>
#include <igtlMessageHeader.h>
#include <igtlPointMessage.h>
#include <igtlSensorMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>
#include <optional>
#include <poll.h>
#include <string>
#include <sys/socket.h>
#include <unistd.h>
#include <utility>
#include <vector>

namespace xraycast {

/// A message as the library takes it apart.
struct Received {
  std::string type, name;
  std::vector<double> values{};  ///< of SENSOR
  igtl::igtlUnit unit = 0;
  int code = 0;  ///< of STATUS
  std::string text{};
  igtl::ImageMessage::Pointer image{};
  igtl::PointMessage::Pointer points{};
  igtl::Matrix4x4 matrix{};  ///< of TRANSFORM
  std::string body{};        ///< of RTS_
};

/// A client as others write them, with the library's sockets and messages.
class IgtlinkTestClient {
 public:
  explicit IgtlinkTestClient(int port) : socket_(igtl::ClientSocket::New()) {
    EXPECT_EQ(socket_->ConnectToServer("127.0.0.1", port), 0);
  }
  ~IgtlinkTestClient() { socket_->CloseSocket(); }
  IgtlinkTestClient(const IgtlinkTestClient&) = delete;
  IgtlinkTestClient& operator=(const IgtlinkTestClient&) = delete;

  bool send(const std::string& bytes) {
    return socket_->Send(bytes.data(), static_cast<int>(bytes.size())) != 0;
  }

  /// The next message; nothing when the connection has ended.
  std::optional<Received> receive() {
    auto header = igtl::MessageHeader::New();
    header->InitPack();
    if (socket_->Receive(header->GetPackPointer(), header->GetPackSize()) != header->GetPackSize()) return {};
    EXPECT_NE(header->Unpack() & igtl::MessageHeader::UNPACK_HEADER, 0);
    Received received{.type = header->GetDeviceType(), .name = header->GetDeviceName()};
    if (received.type == "SENSOR") {
      auto sensor = read_body<igtl::SensorMessage>(header);
      for (unsigned i = 0; i < sensor->GetLength(); ++i) received.values.push_back(sensor->GetValue(i));
      received.unit = sensor->GetUnit();
    } else if (received.type == "IMAGE") {
      received.image = read_body<igtl::ImageMessage>(header);
    } else if (received.type == "POINT") {
      received.points = read_body<igtl::PointMessage>(header);
    } else if (received.type == "TRANSFORM") {
      read_body<igtl::TransformMessage>(header)->GetMatrix(received.matrix);
    } else if (received.type == "STRING") {
      received.text = read_body<igtl::StringMessage>(header)->GetString();
    } else if (received.type.starts_with("RTS_")) {
      received.body.resize(static_cast<std::size_t>(header->GetBodySizeToRead()));
      socket_->Receive(received.body.data(), static_cast<int>(received.body.size()));
    } else {
      EXPECT_EQ(received.type, "STATUS");
      auto status = read_body<igtl::StatusMessage>(header);
      received.code = status->GetCode();
      received.text = status->GetStatusString();
    }
    return received;
  }

  std::optional<Received> receive(const std::string& name) {
    for (;;) {
      auto received = receive();
      if (!received || received->name == name) return received;
    }
  }

  /// Along z, force and torque of one moment; nothing when the connection has ended.
  std::optional<std::pair<double, double>> receive_force_and_torque() {
    const auto force = receive("HubForce"), torque = receive();
    if (!force || !torque) return std::nullopt;
    EXPECT_EQ(torque->name, "HubTorque");
    return std::pair(force->values.at(2), torque->values.at(2));
  }

 private:
  template <typename Message>
  typename Message::Pointer read_body(igtl::MessageHeader::Pointer header) {
    auto message = Message::New();
    message->SetMessageHeader(header);
    message->AllocatePack();
    EXPECT_EQ(socket_->Receive(message->GetPackBodyPointer(), message->GetPackBodySize()),
              message->GetPackBodySize());
    EXPECT_NE(message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY, 0) << "wrong checksum";
    return message;
  }
  igtl::ClientSocket::Pointer socket_;
};

/// A bare connection, for what the library does not let one do.
class BareConnection {
 public:
  explicit BareConnection(int port, int receive_buffer_B = 0) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    if (receive_buffer_B > 0)
      setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_B, sizeof receive_buffer_B);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  }
  ~BareConnection() { close(socket_); }
  BareConnection(const BareConnection&) = delete;
  BareConnection& operator=(const BareConnection&) = delete;

  /// False when the other side has closed.
  bool send(const std::string& bytes) {
    for (std::size_t sent = 0; sent < bytes.size();) {
      const ssize_t n = ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (n < 0) return false;
      sent += static_cast<std::size_t>(n);
    }
    return true;
  }

  /// As send(), but reads what has come where it cannot send for a while. Into a full receive buffer Linux
  /// takes no acknowledgment that comes behind data: what the other side sends again, later and later, then
  /// lets the two go on at the pace of minutes, and a server ends a connection that takes nothing for one.
  bool send_reading_late(const std::string& bytes) {
    constexpr int kStuck_ms = 500;
    for (std::size_t sent = 0; sent < bytes.size();) {
      pollfd ready{socket_, POLLOUT, 0};
      if (poll(&ready, 1, kStuck_ms) == 0) read();
      const ssize_t n =
          ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n < 0 && errno != EAGAIN) return false;
      if (n > 0) sent += static_cast<std::size_t>(n);
    }
    return true;
  }

  /// Sends no more, and reads until the other side has closed.
  void finish() {
    shutdown(socket_, SHUT_WR);
    std::array<char, 4096> ignored;
    while (recv(socket_, ignored.data(), ignored.size(), 0) > 0) continue;
  }

  /// All that can be read now.
  std::string read() {
    std::string bytes(1 << 20, 0);
    std::string all;
    for (ssize_t n; (n = recv(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT)) > 0;)
      all.append(bytes, 0, static_cast<std::size_t>(n));
    return all;
  }

 private:
  int socket_;
};

}  // namespace xraycast
