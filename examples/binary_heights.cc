// Heights of points as numbers, with POSIX sockets alone: c++ -std=c++17 binary_heights.cc && ./a.out 127.0.0.1 8080
// /jacksboro/heights
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

int main(int, char** argv) {
  const std::vector<double> points = {-84.2, 36.3, -84.1, 36.4};  // longitude, latitude
  const std::string body(reinterpret_cast<const char*>(points.data()), points.size() * sizeof(double));
  std::string message = "POST " + std::string(argv[3]) + " HTTP/1.0\r\nHost: " + argv[1] +
                        "\r\nContent-Type: application/octet-stream\r\nContent-Length: " + std::to_string(body.size()) +
                        "\r\n\r\n" + body;
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  if (getaddrinfo(argv[1], argv[2], &hints, &found) != 0) return 1;
  const int connection = socket(found->ai_family, SOCK_STREAM, 0);
  if (connect(connection, found->ai_addr, found->ai_addrlen) != 0) return 1;
  if (write(connection, message.data(), message.size()) < 0) return 1;
  std::string reply;
  char part[65536];
  for (ssize_t size; (size = read(connection, part, sizeof part)) > 0;)
    reply.append(part, static_cast<std::size_t>(size));
  const std::size_t head = reply.find("\r\n\r\n");
  if (reply.compare(9, 3, "200") != 0 || head == std::string::npos)
    return std::fprintf(stderr, "%s\n", reply.c_str()), 1;
  std::vector<float> heights(points.size() / 2);
  std::memcpy(heights.data(), reply.data() + head + 4, heights.size() * sizeof(float));
  for (const float height : heights) std::printf("%.3f\n", static_cast<double>(height));
}
