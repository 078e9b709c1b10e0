defmodule Hal.RPLidar do
  @moduledoc """
  Speaks the bytes of SLAMTEC's RPLIDAR A1 and A2. No process, no line: `Hal.RPLidar.Driver` owns that.

  A request is `A5 cmd`, and with a payload `A5 cmd len payload xor`. An answer begins with a descriptor of 7 bytes,
  `A5 5A`, the length of its data (30 bits, then 2 that tell a stream), and its type.
  """
  import Bitwise

  @commands %{
    stop: 0x25,
    reset: 0x40,
    scan: 0x20,
    info: 0x50,
    health: 0x52,
    express: 0x82,
    motor: 0xF0
  }
  # What turns the motor of an A2 at its usual speed.
  @turning 660

  @doc """
  The bytes of a request.

      iex> for what <- [:stop, :scan, :express, {:motor, true}], do: Base.encode16(Hal.RPLidar.request(what))
      ["A525", "A520", "A58205000000000022", "A5F0029402C1"]
  """
  @spec request(:stop | :reset | :scan | :info | :health | :express | {:motor, boolean()}) ::
          binary()
  def request({:motor, on?}), do: request(:motor, <<if(on?, do: @turning, else: 0)::16-little>>)
  def request(:express), do: request(:express, <<0::40>>)
  def request(name), do: <<0xA5, Map.fetch!(@commands, name)>>

  defp request(name, payload) do
    bytes = <<0xA5, Map.fetch!(@commands, name), byte_size(payload), payload::binary>>
    <<bytes::binary, xor(bytes)>>
  end

  @doc "All bytes by exclusive or."
  @spec xor(binary()) :: byte()
  def xor(bytes), do: for(<<byte <- bytes>>, reduce: 0, do: (sum -> bxor(sum, byte)))

  @doc """
  The first answer in these bytes: its type and what follows its descriptor; `:more` with the bytes that may still become one.

      iex> Hal.RPLidar.answer("boot" <> <<0xA5, 0x5A, 3, 0, 0, 0, 6, 0, 0, 0>>)
      {:ok, 6, 3, <<0, 0, 0>>}
      iex> Hal.RPLidar.answer("boot" <> <<0xA5, 0x5A, 3>>)
      {:more, <<0xA5, 0x5A, 3>>}
  """
  @spec answer(binary()) ::
          {:ok, type :: byte(), length :: non_neg_integer(), rest :: binary()} | {:more, binary()}
  def answer(<<0xA5, 0x5A, size::32-little, type, rest::binary>>),
    do: {:ok, type, size &&& 0x3FFFFFFF, rest}

  def answer(<<0xA5, 0x5A, _::binary>> = begun), do: {:more, begun}
  def answer(<<0xA5>> = begun), do: {:more, begun}
  def answer(<<_, rest::binary>>), do: answer(rest)
  def answer(<<>>), do: {:more, <<>>}
end
