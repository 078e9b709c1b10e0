defmodule Player.Wire do
  @moduledoc """
  Writes and reads the messages of Player 3's protocol on TCP: a header of 40 bytes and a payload (`Player.Xdr`). Pure.

      header: host, robot, interface, index, type, subtype (4 bytes each), time (a double, s since 1970), 0, size of the payload

  The payloads of all messages that are understood here are in one table. Angles are in radians, lengths in metres; a pose is
  `{x, y, yaw}`, or `{x, y, z, roll, pitch, yaw}`; a size is `{width, length, height}`.
  """
  alias Player.Xdr

  @header_bytes 40
  # No request of a client needs more; Player itself takes 8 MiB.
  @most_bytes 65_536

  @interfaces %{
    player: 1,
    power: 2,
    position2d: 4,
    sonar: 5,
    laser: 6,
    blobfinder: 7,
    ptz: 8,
    fiducial: 10,
    speech: 12,
    bumper: 14,
    ir: 22,
    localize: 25,
    simulation: 31,
    camera: 40,
    map: 42,
    ranger: 62
  }
  @names Map.new(@interfaces, fn {name, code} -> {code, name} end)
  @types %{data: 1, cmd: 2, req: 3, ack: 4, synch: 5, nack: 6}
  @type_names Map.new(@types, fn {name, code} -> {code, name} end)

  @pose2d {:tuple, [:double, :double, :double]}
  @pose3d {:tuple, [:double, :double, :double, :double, :double, :double]}
  @size {:tuple, [:double, :double, :double]}
  @address [host: :u32, robot: :u32, interf: :u32, index: :u32]
  @driver [address: @address, driver: :bytes]
  @dev [address: @address, access: :u32, driver: :bytes]
  @geometry [pose: @pose3d, size: @size]
  @poses [poses: {:list, @pose3d}]
  @named_pose [name: :bytes, pose: @pose2d]
  @on [on: :u32]
  @image [
    width: :u32,
    height: :u32,
    bpp: :u32,
    format: :u32,
    fdiv: :u32,
    compression: :u32,
    image: :bytes
  ]
  @blob [
    id: :u32,
    color: :u32,
    area: :u32,
    x: :u32,
    y: :u32,
    left: :u32,
    right: :u32,
    top: :u32,
    bottom: :u32,
    range: :float
  ]
  # The number of bytes stands before what a cell of 1 means, and these are compressed by zlib.
  @tile [
    column: :u32,
    row: :u32,
    width: :u32,
    height: :u32,
    count: :u32,
    range: :i32,
    data: :opaque
  ]

  @layouts %{
    {:player, :req, 1} => [],
    {:player, :ack, 1} => [devices: {:list, @address}],
    {:player, :req, 2} => @driver,
    {:player, :ack, 2} => @driver,
    {:player, :req, 3} => @dev,
    {:player, :ack, 3} => @dev,
    {:player, :nack, 3} => @dev,
    {:player, :req, 4} => [],
    {:player, :req, 5} => [mode: :u32],
    {:player, :req, 10} => [interf: :i32, index: :i32, type: :i32, subtype: :i32, rule: :i32],
    {:player, :synch, 1} => [],
    {:player, :synch, 2} => [dropped: :u32],
    {:power, :data, 1} => [
      valid: :u32,
      volts: :float,
      percent: :float,
      joules: :float,
      watts: :float,
      charging: :i32
    ],
    {:position2d, :data, 1} => [pose: @pose2d, speed: @pose2d, stall: :u32],
    {:position2d, :cmd, 1} => [speed: @pose2d, on: :u32],
    {:position2d, :cmd, 2} => [pose: @pose2d, speed: @pose2d, on: :u32],
    {:position2d, :req, 1} => [],
    {:position2d, :ack, 1} => @geometry,
    {:position2d, :req, 2} => @on,
    {:position2d, :req, 3} => [mode: :u32],
    {:position2d, :req, 4} => [mode: :u32],
    {:position2d, :req, 5} => [pose: @pose2d],
    {:position2d, :req, 6} => [],
    {:sonar, :data, 1} => [ranges: {:list, :float}],
    {:sonar, :req, 1} => [],
    {:sonar, :ack, 1} => @poses,
    {:sonar, :req, 2} => @on,
    {:laser, :data, 1} => [
      min_angle: :float,
      max_angle: :float,
      resolution: :float,
      max_range: :float,
      ranges: {:list, :float},
      intensity: :bytes,
      id: :u32
    ],
    {:laser, :req, 1} => [],
    {:laser, :ack, 1} => @geometry,
    {:laser, :req, 3} => [],
    {:laser, :ack, 3} => [
      min_angle: :float,
      max_angle: :float,
      resolution: :float,
      max_range: :float,
      range_res: :float,
      intensity: :u32,
      frequency: :float
    ],
    {:blobfinder, :data, 1} => [width: :u32, height: :u32, blobs: {:list, @blob}],
    {:ptz, :data, 1} => [
      pan: :float,
      tilt: :float,
      zoom: :float,
      pan_speed: :float,
      tilt_speed: :float,
      status: :u32
    ],
    {:ptz, :cmd, 1} => [
      pan: :float,
      tilt: :float,
      zoom: :float,
      pan_speed: :float,
      tilt_speed: :float
    ],
    {:ptz, :req, 4} => [],
    {:ptz, :ack, 4} => @geometry,
    {:ptz, :req, 5} => [],
    {:ptz, :ack, 5} => [status: :u32],
    {:fiducial, :data, 1} => [
      marks: {:list, [id: :i32, pose: @pose3d, sd: @pose3d]}
    ],
    {:fiducial, :req, 1} => [],
    {:fiducial, :ack, 1} => [
      pose: @pose3d,
      size: @size,
      mark: {:tuple, [:double, :double]}
    ],
    {:speech, :cmd, 1} => [text: :bytes],
    {:bumper, :data, 1} => [bumpers: :bytes],
    {:bumper, :req, 1} => [],
    {:bumper, :ack, 1} => [
      bumpers: {:list, [pose: @pose3d, length: :float, radius: :float]}
    ],
    {:ir, :data, 1} => [voltages: {:list, :float}, ranges: {:list, :float}],
    {:ir, :req, 1} => [],
    {:ir, :ack, 1} => @poses,
    {:ir, :req, 2} => @on,
    {:localize, :data, 1} => [
      pending: :u32,
      pending_time: :double,
      hypotheses: {:list, [mean: @pose2d, covariance: @pose3d, alpha: :double]}
    ],
    # Clients send what their memory holds for a pose.
    {:simulation, :req, 1} => [name: :bytes, pose: {:raw, 24}],
    {:simulation, :ack, 1} => @named_pose,
    {:camera, :data, 1} => @image,
    {:map, :req, 1} => [],
    {:map, :ack, 1} => [scale: :float, width: :u32, height: :u32, origin: @pose2d],
    {:map, :req, 2} => @tile,
    {:map, :ack, 2} => @tile,
    {:ranger, :data, 1} => [ranges: {:list, :double}],
    {:ranger, :req, 1} => [],
    {:ranger, :ack, 1} => @geometry ++ [poses: {:list, @pose3d}, sizes: {:list, @size}],
    {:ranger, :req, 2} => @on,
    {:ranger, :req, 5} => [],
    {:ranger, :ack, 5} => [
      min_angle: :double,
      max_angle: :double,
      angular_res: :double,
      min_range: :double,
      max_range: :double,
      range_res: :double,
      frequency: :double
    ]
  }

  @typedoc "An interface by name; one that is not known here by its code."
  @type interface :: atom() | non_neg_integer()
  @type device :: {interface(), index :: non_neg_integer()}
  @type kind :: :data | :cmd | :req | :ack | :synch | :nack

  @typedoc "A message that was heard; `kind` is a code where it is not known."
  @type heard :: %{
          device: device(),
          kind: kind() | non_neg_integer(),
          subtype: non_neg_integer(),
          payload: binary()
        }

  @doc "What a server says first: 32 bytes."
  @spec banner() :: binary()
  def banner, do: String.pad_trailing("Player v.3.1.1 Convoy", 32, <<0>>)

  @doc """
  A message, without the first 8 bytes of its header, which say whose it is (`from/2`), so that one is written for all clients.
  `at_s` are seconds since 1970.

      iex> <<1::32, 0::32, 4::32, 5::32, 0::64, 0::32, 0::32>> = Player.Wire.encode({:player, 0}, :ack, 5, %{}, 0.0)
      iex> byte_size(Player.Wire.encode({:sonar, 0}, :data, 1, %{ranges: [1.0, 2.0]}, 0.0))
      48
  """
  @spec encode(device(), kind(), subtype :: non_neg_integer(), map(), at_s :: float()) :: binary()
  def encode({interface, index}, kind, subtype, values, at_s) do
    # Most answers say yes or no, and nothing else.
    payload =
      if values == %{},
        do: "",
        else: Xdr.encode(Map.fetch!(@layouts, {interface, kind, subtype}), values)

    <<code(interface)::32, index::32, @types[kind]::32, subtype::32, at_s::float-64, 0::32,
      byte_size(payload)::32, payload::binary>>
  end

  defp code(interface) when is_integer(interface), do: interface
  defp code(interface), do: Map.fetch!(@interfaces, interface)

  @doc "The first 8 bytes of a header: the address of the server as Player writes it, and its port."
  @spec from(:inet.ip4_address(), :inet.port_number()) :: binary()
  def from({a, b, c, d}, port), do: <<d, c, b, a, port::32>>

  @doc "The host and the port of an address in a payload."
  @spec host(:inet.ip4_address()) :: non_neg_integer()
  def host({a, b, c, d}) do
    <<host::32>> = <<d, c, b, a>>
    host
  end

  @doc """
  Cuts what a client has said into whole messages and the rest; the error is for what no client says.

      iex> bytes = <<0::64, 1::32, 0::32, 3::32, 5::32, 0::64, 0::32, 4::32, 2::32>>
      iex> Player.Wire.cut(bytes <> "re")
      {:ok, [%{device: {:player, 0}, kind: :req, subtype: 5, payload: <<2::32>>}], "re"}
      iex> Player.Wire.cut("GET / HTTP/1.1\\r\\nHost: 127.0.0.1:6665\\r\\n\\r\\n")
      :error
  """
  @spec cut(binary()) :: {:ok, [heard()], rest :: binary()} | :error
  def cut(bytes), do: cut(bytes, [])

  defp cut(
         <<_from::64, interface::32, index::32, type::32, subtype::32, _at::64, _seq::32,
           size::32, more::binary>> = bytes,
         heard
       ) do
    cond do
      size > @most_bytes ->
        :error

      size > byte_size(more) ->
        {:ok, Enum.reverse(heard), bytes}

      true ->
        <<payload::binary-size(size), rest::binary>> = more
        device = {Map.get(@names, interface, interface), index}
        kind = Map.get(@type_names, type, type)

        cut(rest, [%{device: device, kind: kind, subtype: subtype, payload: payload} | heard])
    end
  end

  defp cut(bytes, heard) when byte_size(bytes) < @header_bytes,
    do: {:ok, Enum.reverse(heard), bytes}

  @doc """
  The values of a message's payload, of those in the table. A request without values may have any payload.

      iex> Player.Wire.values(%{device: {:player, 0}, kind: :req, subtype: 5, payload: <<2::32>>})
      {:ok, %{mode: 2}}
      iex> Player.Wire.values(%{device: {:player, 0}, kind: :req, subtype: 5, payload: <<2>>})
      :error
  """
  @spec values(heard()) :: {:ok, map()} | :error
  def values(%{device: {interface, _index}, kind: kind, subtype: subtype, payload: payload}) do
    case @layouts do
      %{{^interface, ^kind, ^subtype} => []} -> {:ok, %{}}
      %{{^interface, ^kind, ^subtype} => layout} -> Xdr.decode(layout, payload)
      _not_known -> :error
    end
  end

  @doc "The codes of a message, as rules of queues name them: interface, index, type, subtype."
  @spec codes(device(), kind(), non_neg_integer()) ::
          {non_neg_integer(), non_neg_integer(), non_neg_integer(), non_neg_integer()}
  def codes({interface, index}, kind, subtype),
    do: {code(interface), index, Map.fetch!(@types, kind), subtype}
end
