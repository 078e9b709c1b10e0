defmodule Hal.Serial.Line do
  @moduledoc """
  Defines an implementation of `Hal.Serial`: `Hal.Serial.Native`, which is always available, or `Hal.Serial.Circuits`,
  where `circuits_uart` is installed. All functions are called by the process that opened the line.
  """

  @type t :: term()
  @type reason ::
          :enoent
          | :eacces
          | :ebusy
          | :eio
          | :enodev
          | :enxio
          | :enotty
          | :einval
          | :eexist
          | :speed
          | :unplugged
          | :terminated
          | :overrun
          | :closed
          | :timeout
          | :clock
          | :frozen
          | :last_words
          | {:exit, status :: term()}
          | {:os, String.t()}

  @doc "Opens a line with options that `Hal.Serial.options/1` has checked."
  @callback open(keyword()) :: {:ok, t()} | {:error, reason()}

  @doc "Takes bytes to write; a sign of life."
  @callback write(t(), iodata()) :: :ok | {:error, reason()}

  @doc "Sets the last words; a sign of life."
  @callback last_words(t(), binary()) :: :ok | {:error, reason()}

  @doc "A sign of life."
  @callback keep_alive(t()) :: :ok | {:error, reason()}

  @doc "Writes the last words and closes."
  @callback close(t()) :: :ok

  @doc "Interprets a message."
  @callback handle(t(), message :: term()) :: {:data, binary()} | {:error, reason()} | :unknown
end
