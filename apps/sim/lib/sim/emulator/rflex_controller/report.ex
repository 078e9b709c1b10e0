defmodule Sim.Emulator.RFlexController.Report do
  @moduledoc false
  # Encodes the data of a controller's reports (fact sheet rFLEX, sections 4 to 9). Pure; all numbers big-endian, `at` is
  # the controller's time stamp.

  @type data :: {port :: byte(), opcode :: byte(), binary()}

  @doc "One axis: counter, counts/s, and the last command."
  @spec motor(non_neg_integer(), 0 | 1, {integer(), integer()}, {integer(), integer()}) :: data()
  def motor(at, axis, {position, velocity}, {acceleration, torque}) do
    {2, 33, <<0::32, at::32, axis, position::32, velocity::32, acceleration::32, torque::32>>}
  end

  @doc "Echoes: sonar id and raw range."
  @spec sonar(non_neg_integer(), [{byte(), 0..0xFFFF}]) :: data()
  def sonar(at, echoes) do
    {4, 2, <<0::32, at::32, for({id, raw} <- echoes, into: <<>>, do: <<id, raw::16>>)::binary>>}
  end

  @doc "Infrared: a list of bytes for each board."
  @spec infrared(non_neg_integer(), [[byte()]]) :: data()
  def infrared(at, banks) do
    boards =
      for bank <- banks, into: <<>> do
        eight = bank |> Stream.concat(Stream.cycle([0])) |> Enum.take(8)
        <<at::32, :binary.list_to_bin(eight)::binary, 0x80>>
      end

    {6, 1, <<length(banks), boards::binary>>}
  end

  @doc "A digital input."
  @spec input(non_neg_integer(), byte(), 0..0xFFFF) :: data()
  def input(at, address, state), do: {5, 1, <<at::32, address, state::16>>}

  @doc "The answer to a request for digital inputs; its purpose is unknown."
  @spec inputs_wanted(non_neg_integer()) :: data()
  def inputs_wanted(at), do: {5, 0, <<0::32, at::32>>}

  @doc "Battery in hundredths of a volt, and whether the brake is set."
  @spec status(non_neg_integer(), non_neg_integer(), boolean()) :: data()
  def status(at, centivolts, brake?),
    do: {1, 1, <<at::32, centivolts::32, if(brake?, do: 1, else: 0)>>}

  @doc "The joystick: both axes in its counts, and the buttons' bits."
  @spec joystick(non_neg_integer(), integer(), integer(), byte()) :: data()
  def joystick(at, x, y, buttons), do: {3, 0, <<at::32, x::32, y::32, buttons>>}

  @doc "A row of the screen."
  @spec row(non_neg_integer(), 0..239, binary()) :: data()
  def row(at, row, bytes), do: {1, 0, <<at::32, row, byte_size(bytes), bytes::binary>>}
end
