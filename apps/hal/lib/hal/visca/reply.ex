defmodule Hal.Visca.Reply do
  @moduledoc """
  Replies of a VISCA camera (fact sheet, section 3), without the final 0xFF. Pure.

  | reply | when |
  |---|---|
  | `{:ack, socket}` | a command was accepted |
  | `{:done, socket}` | the command is done: for moves, when the movement ends |
  | `{:result, bytes}` | the answer to an inquiry; without bytes, to `:if_clear_one` |
  | `{:error, socket, reason}` | see `t:reason/0`; socket 0 if the command never had one |
  | `:network_change` | a camera of the chain was switched on |
  | `{:cameras, n}` | the answer to `:address_set` |
  | `:cleared` | the answer to `:if_clear` |
  """
  alias Hal.Visca.Command

  @typedoc """
  `:full`: both sockets are busy. `:not_executable`: not now; the camera is switched off, or does
  something that excludes it. `:no_socket`: nothing to cancel there.
  """
  @type reason ::
          :length | :syntax | :full | :cancelled | :no_socket | :not_executable | {:code, byte()}
  @type t ::
          {:ack, 1..2}
          | {:done, 1..2}
          | {:result, binary()}
          | {:error, 0..2, reason()}
          | :network_change
          | {:cameras, 0..7}
          | :cleared

  @doc """
  A reply, and the number of the camera that sent it (0: a broadcast).

      iex> Hal.Visca.Reply.decode(<<0x90, 0x41>>)
      {:ok, 1, {:ack, 1}}
      iex> Hal.Visca.Reply.decode(<<0xA0, 0x60, 0x02>>)
      {:ok, 2, {:error, 0, :syntax}}
      iex> Hal.Visca.Reply.decode(<<0x90, 0x43>>)
      :error
  """
  @spec decode(binary()) :: {:ok, camera :: 0..7, t()} | :error
  def decode(<<0x88, 0x30, 0x0::4, w::4>>) when w in 1..8, do: {:ok, 0, {:cameras, w - 1}}
  def decode(<<0x88, 0x01, 0x00, 0x01>>), do: {:ok, 0, :cleared}

  def decode(<<1::1, camera::3, 0::4, payload::binary>>) when camera in 1..7 do
    case payload(payload) do
      :error -> :error
      reply -> {:ok, camera, reply}
    end
  end

  def decode(_bytes), do: :error

  defp payload(<<4::4, socket::4>>) when socket in 1..2, do: {:ack, socket}
  defp payload(<<5::4, socket::4>>) when socket in 1..2, do: {:done, socket}
  defp payload(<<0x50, bytes::binary>>) when byte_size(bytes) <= 13, do: {:result, bytes}

  defp payload(<<6::4, socket::4, code>>) when socket in 0..2,
    do: {:error, socket, reason(code)}

  defp payload(<<0x38>>), do: :network_change
  defp payload(_other), do: :error

  defp reason(0x01), do: :length
  defp reason(0x02), do: :syntax
  defp reason(0x03), do: :full
  defp reason(0x04), do: :cancelled
  defp reason(0x05), do: :no_socket
  defp reason(0x41), do: :not_executable
  defp reason(code), do: {:code, code}

  @doc """
  Why a command came to nothing, in words, for the reasons of `Hal.Visca.Queue` too.

      iex> Hal.Visca.Reply.refusal(:syntax)
      "it does not know the command (syntax error)"
      iex> Hal.Visca.Reply.refusal({:code, 0x42})
      "error 42"
  """
  @spec refusal(reason() | :no_answer | :no_completion | :malformed) :: String.t()
  def refusal(:syntax), do: "it does not know the command (syntax error)"
  def refusal(:length), do: "it finds the message too long"
  def refusal(:full), do: "it is busy"
  def refusal(:not_executable), do: "it cannot do that now (not executable)"
  def refusal(:no_answer), do: "it does not answer to that"
  def refusal(:no_completion), do: "it accepted the command, and never said that it was done"
  def refusal(:malformed), do: "its answer cannot be read"
  def refusal({:code, code}), do: "error #{Integer.to_string(code, 16)}"
  def refusal(reason), do: "#{reason}"

  @doc """
  Reads the bytes of a result as the answer to an inquiry; `:error` if they cannot be one.

  | inquiry | value |
  |---|---|
  | `:version` | `%{vendor:, model:, rom:, sockets:}`; the models: `Hal.Visca.Model` |
  | `:power` | `true` or `false` |
  | `:zoom` | as the camera reports it, for a D30 0 to 1023 |
  | `:position` | `{pan, tilt}`, signed |
  | `:max_speed` | `{pan, tilt}` |
  | `:status` | 16 bits |
  | `:screen` | `:on`, `:off` |
  | `:video` | `:ntsc`, `:pal` |
  | `:focus` | `:auto`, `:manual` |

      iex> Hal.Visca.Reply.value(:position, <<0x0F, 0x0E, 0x0F, 0x08, 0, 0, 7, 8>>)
      {:ok, {-264, 120}}
      iex> Hal.Visca.Reply.value(:zoom, <<0x90, 0, 0, 0>>)
      :error
  """
  @spec value(Command.inquiry(), binary()) :: {:ok, term()} | :error
  def value(:version, <<vendor::16, model::16, rom::16, sockets>>),
    do: {:ok, %{vendor: vendor, model: model, rom: rom, sockets: sockets}}

  def value(:power, <<2>>), do: {:ok, true}
  def value(:power, <<3>>), do: {:ok, false}

  def value(:zoom, <<0::4, p::4, 0::4, q::4, 0::4, r::4, 0::4, s::4>>) do
    <<z::16>> = <<p::4, q::4, r::4, s::4>>
    {:ok, z}
  end

  def value(:position, <<pan::binary-size(4), tilt::binary-size(4)>>) do
    with {:ok, pan} <- signed(pan), {:ok, tilt} <- signed(tilt), do: {:ok, {pan, tilt}}
  end

  def value(:max_speed, <<pan, tilt>>), do: {:ok, {pan, tilt}}
  def value(:status, <<bits::16>>), do: {:ok, bits}
  def value(:screen, <<2>>), do: {:ok, :on}
  def value(:screen, <<3>>), do: {:ok, :off}
  def value(:video, <<0>>), do: {:ok, :ntsc}
  def value(:video, <<1>>), do: {:ok, :pal}
  def value(:focus, <<2>>), do: {:ok, :auto}
  def value(:focus, <<3>>), do: {:ok, :manual}
  def value(_inquiry, _bytes), do: :error

  defp signed(<<0::4, a::4, 0::4, b::4, 0::4, c::4, 0::4, d::4>>) do
    <<n::signed-16>> = <<a::4, b::4, c::4, d::4>>
    {:ok, n}
  end

  defp signed(_not_nibbles), do: :error
end
